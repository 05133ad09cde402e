//! What surrounds the part: the switch, the slot, the LEDs, the line and the pins.

use register_map::Module;

use super::{Board, Error};
use crate::line::Line;
use crate::periph::gpio::Gpio;
use crate::slot::{BusFault, Channel, Slot};
use crate::time::Time;

/// The three LEDs, as a person sees them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Leds {
    /// Line activity: PB8, high = on.
    pub activity: bool,
    /// Fault: PB9, high = on.
    pub fault: bool,
    /// Running: PC13, low = on.
    pub run: bool,
}

impl Board {
    /// The DIP switch: bit 0 = position 1, a set bit = ON.
    #[must_use]
    pub fn dip(&self) -> u8 {
        self.dip
    }

    /// Moves the DIP switch.
    pub fn set_dip(&mut self, dip: u8) {
        self.dip = dip;
        let now = self.now();
        self.machine.bus.soc.set_switch(dip, now);
    }

    /// Whether the 8 MHz crystal works.
    #[must_use]
    pub fn crystal(&self) -> bool {
        self.machine.bus.soc.rcc.crystal()
    }

    /// Lets the crystal die at this instant, or come back: then it starts again where RCC still has it on.
    pub fn set_crystal(&mut self, works: bool) {
        self.sync();
        let now = self.now();
        self.machine.bus.soc.set_crystal(works, now);
    }

    /// The supply of the part, in millivolts.
    #[must_use]
    pub fn supply_mv(&self) -> u16 {
        self.machine.bus.soc.pwr.supply_mv()
    }

    /// Sets the supply of the part. It stays so over a power cycle.
    ///
    /// # Errors
    ///
    /// [`Error::Range`] outside the part's 2000 to 3600 mV (DS5319 table 9): below them it is reset, for
    /// which there is [`Board::power_off`].
    pub fn set_supply_mv(&mut self, millivolts: u16) -> Result<(), Error> {
        if !(2000..=3600).contains(&millivolts) {
            return Err(Error::Range("the supply is 2000 to 3600 mV"));
        }
        self.sync();
        self.machine.bus.soc.pwr.set_supply_mv(millivolts);
        Ok(())
    }

    /// What is plugged into the slot.
    #[must_use]
    pub fn module(&self) -> Module {
        self.slot().module()
    }

    /// Plugs another module, a new one.
    ///
    /// # Errors
    ///
    /// [`Error::Powered`] while the power is on.
    pub fn set_module(&mut self, module: Module) -> Result<(), Error> {
        if self.powered() {
            return Err(Error::Powered);
        }
        self.with_slot(|slot| slot.set_module(module));
        Ok(())
    }

    /// Energises the digital input on channel `ch` (1 to 4) or takes the voltage away.
    ///
    /// # Errors
    ///
    /// [`Error::Channel`] when that channel is no digital input.
    pub fn set_energised(&mut self, ch: usize, energised: bool) -> Result<(), Error> {
        Ok(self.with_slot(|slot| slot.set_energised(ch, energised))?)
    }

    /// Sets the jumper of relay `ch` (1 or 2) to manual or back.
    ///
    /// # Errors
    ///
    /// [`Error::Channel`] when that channel is no relay.
    pub fn set_manual(&mut self, ch: usize, manual: bool) -> Result<(), Error> {
        Ok(self.with_slot(|slot| slot.set_manual(ch, manual))?)
    }

    /// Puts a voltage on the analog input of channel `ch` (1 to 4), 0 to 3300 mV at the pin.
    ///
    /// # Errors
    ///
    /// [`Error::Channel`] when that channel is no analog input, [`Error::Range`] above 3300.
    pub fn set_millivolts(&mut self, ch: usize, millivolts: u16) -> Result<(), Error> {
        Ok(self.with_slot(|slot| slot.set_millivolts(ch, millivolts))?)
    }

    /// Sets the source impedance of the analog input of channel `ch` (1 to 4), in ohms.
    ///
    /// # Errors
    ///
    /// [`Error::Channel`] when that channel is no analog input.
    pub fn set_source_ohms(&mut self, ch: usize, ohms: u32) -> Result<(), Error> {
        Ok(self.with_slot(|slot| slot.set_source_ohms(ch, ohms))?)
    }

    /// Breaks the DAC or its wires, or repairs them.
    pub fn set_bus_fault(&mut self, fault: BusFault) {
        self.with_slot(|slot| slot.set_bus_fault(fault));
    }

    /// Locks the analog filters of I2C1 low, as the rise of the supply may: the part then sees a busy bus until
    /// both wires have had an edge. It may be done while the power is off.
    pub fn lock_i2c_filters(&mut self) {
        self.sync();
        let now = self.now();
        self.machine.bus.soc.lock_i2c_filters(now);
    }

    /// Disturbs the wires of I2C1 at this instant with what looks like a start condition. Returns whether a byte
    /// was under way, which makes it a bus error.
    pub fn disturb_i2c(&mut self) -> bool {
        self.sync();
        let now = self.now();
        self.machine.bus.soc.disturb_i2c(now)
    }

    /// Channel `ch` (1 to 4) of the plugged module; [`Channel::None`] for any other number.
    #[must_use]
    pub fn channel(&self, ch: usize) -> Channel {
        self.slot().channel(ch)
    }

    /// The slot, to look at.
    #[must_use]
    pub fn slot(&self) -> &Slot {
        &self.machine.bus.soc.slot
    }

    /// Does something to the slot at this instant; the part sees it at once.
    fn with_slot<T>(&mut self, action: impl FnOnce(&mut Slot) -> T) -> T {
        self.sync();
        let answer = action(&mut self.machine.bus.soc.slot);
        let now = self.now();
        self.machine.bus.soc.refresh(now);
        answer
    }

    /// The LEDs.
    #[must_use]
    pub fn leds(&self) -> Leds {
        // Without power nothing shines, though PC13 is as low as with the LED on.
        Leds {
            activity: self.pin('B', 8),
            fault: self.pin('B', 9),
            run: self.powered() && self.is_output('C', 13) && !self.pin('C', 13),
        }
    }

    /// Whether the RS-485 driver is on (PA8).
    #[must_use]
    pub fn driver_enable(&self) -> bool {
        self.pin('A', 8)
    }

    /// The RS-485 line, to send on and to read what was sent.
    pub fn line(&mut self) -> &mut Line {
        self.sync();
        &mut self.machine.bus.soc.line
    }

    /// The level at a pin, as a logic probe sees it: port `'A'` to `'D'`, pin 0 to 15; low for a pin
    /// that does not exist.
    #[must_use]
    pub fn pin(&self, port: char, pin: u8) -> bool {
        self.port(port)
            .is_some_and(|gpio| pin < 16 && gpio.level() >> pin & 1 != 0)
    }

    fn is_output(&self, port: char, pin: u8) -> bool {
        self.port(port)
            .is_some_and(|gpio| gpio.outputs() >> pin & 1 != 0)
    }

    /// Records the edges of a pin from now on.
    pub fn watch_pin(&mut self, port: char, pin: u8) {
        if let Some(index) = port_index(port).filter(|_| pin < 16) {
            self.machine.bus.soc.gpio[index].watch(usize::from(pin));
        }
    }

    /// The recorded edges of a watched pin: when, and the level after it.
    #[must_use]
    pub fn pin_edges(&self, port: char, pin: u8) -> &[(Time, bool)] {
        self.port(port)
            .filter(|_| pin < 16)
            .map_or(&[], |gpio| gpio.edges(usize::from(pin)))
    }

    fn port(&self, port: char) -> Option<&Gpio> {
        port_index(port).map(|index| &self.machine.bus.soc.gpio[index])
    }
}

fn port_index(port: char) -> Option<usize> {
    "ABCD".find(port.to_ascii_uppercase())
}
