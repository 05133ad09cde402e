//! What surrounds the part on a modio board: the switch, the slots, the LEDs and the line.

use register_map::Module;

use super::{Board, Error, Layout};
use crate::line::Line;
use crate::slot::{BusFault, Channel, Slot};

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
        self.circuit().dip
    }

    /// Moves the DIP switch.
    pub fn set_dip(&mut self, dip: u8) {
        self.change(|circuit| circuit.dip = dip);
    }

    /// Which board it is.
    #[must_use]
    pub fn layout(&self) -> &'static Layout {
        self.circuit().layout
    }

    /// What is plugged into the first slot.
    #[must_use]
    pub fn module(&self) -> Module {
        self.slot().module()
    }

    /// Plugs another module, a new one, into the first slot.
    ///
    /// # Errors
    ///
    /// [`Error::Powered`] while the power is on.
    pub fn set_module(&mut self, module: Module) -> Result<(), Error> {
        self.set_module_at(self.layout().slots[0].port, module)
    }

    /// Plugs another module, a new one, into the slot at `port`.
    ///
    /// # Errors
    ///
    /// [`Error::Powered`] while the power is on, [`Error::Slot`] when the board has no such slot.
    pub fn set_module_at(&mut self, port: u8, module: Module) -> Result<(), Error> {
        if self.powered() {
            return Err(Error::Powered);
        }
        self.change_slot(port, |slot| slot.set_module(module))
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

    /// Channel `ch` (1 to 4) of the module in the first slot; [`Channel::None`] for any other number.
    #[must_use]
    pub fn channel(&self, ch: usize) -> Channel {
        self.slot().channel(ch)
    }

    /// The first slot, to look at.
    #[must_use]
    pub fn slot(&self) -> &Slot {
        &self.circuit().slots[0]
    }

    /// The slots with the numbers of their ports, the first one first.
    pub fn slots(&self) -> impl Iterator<Item = (u8, &Slot)> {
        let ports = self.layout().slots.iter().map(|pins| pins.port);
        ports.zip(&self.circuit().slots)
    }

    /// Does something to the slot at `port` at this instant; the part sees it immediately.
    ///
    /// # Errors
    ///
    /// [`Error::Slot`] when the board has no such slot.
    pub fn change_slot<T>(
        &mut self,
        port: u8,
        action: impl FnOnce(&mut Slot) -> T,
    ) -> Result<T, Error> {
        let slots = self.layout().slots.iter();
        let n = slots
            .map(|pins| pins.port)
            .position(|known| known == port)
            .ok_or(Error::Slot(port))?;
        Ok(self.change(|circuit| action(&mut circuit.slots[n])))
    }

    fn with_slot<T>(&mut self, action: impl FnOnce(&mut Slot) -> T) -> T {
        self.change(|circuit| action(&mut circuit.slots[0]))
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

    /// Writes to USART1's data register since the last reset: one for each byte the firmware sends.
    #[must_use]
    pub fn line_bytes_written(&self) -> u64 {
        self.machine.bus.soc.usart1().data_writes()
    }

    /// The RS-485 line, to send on and to read what was sent.
    pub fn line(&mut self) -> &mut Line {
        self.sync();
        &mut self.machine.bus.soc.circuit.line
    }
}
