//! Operates and reads a modio board: its DIP switch, slots, LEDs, line and LoRa module.

use register_map::Module;

use super::layout::Led;
use super::terminals::{Terminals, Value};
use super::{Board, Error, Layout, Rs232};
use crate::line::Line;
use crate::radio::{self, Air};
use crate::slot::{BusFault, Channel, Slot};

/// The three LEDs; `true` = lit. An LED that the board does not have is off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Leds {
    /// Line activity.
    pub activity: bool,
    /// Fault.
    pub fault: bool,
    /// Running.
    pub run: bool,
}

impl Board {
    /// Returns the DIP switch: bit 0 = position 1, a set bit = ON.
    #[must_use]
    pub fn dip(&self) -> u8 {
        self.circuit().dip
    }

    /// Returns the position of the DIP switch when the power was switched on last, which is in force.
    #[must_use]
    pub fn dip_at_power_on(&self) -> u8 {
        self.circuit().dip_at_power_on
    }

    /// Moves the DIP switch.
    pub fn set_dip(&mut self, dip: u8) {
        self.change(|circuit| circuit.dip = dip);
    }

    /// Returns the type of the board.
    #[must_use]
    pub fn layout(&self) -> &'static Layout {
        self.circuit().layout
    }

    /// Returns the module in the first slot; [`Module::None`] if the board has no slot.
    #[must_use]
    pub fn module(&self) -> Module {
        self.circuit()
            .slots
            .first()
            .map_or(Module::None, Slot::module)
    }

    /// Plugs a new module into the first slot.
    ///
    /// # Errors
    ///
    /// [`f103::Error::Powered`] while the power is on.
    pub fn set_module(&mut self, module: Module) -> Result<(), Error> {
        self.set_module_at(self.first_port(), module)
    }

    /// Returns the port of the first slot; 1 if the board has no slot.
    #[must_use]
    pub fn first_port(&self) -> u8 {
        self.layout().slots.first().map_or(1, |slot| slot.port)
    }

    /// Plugs a new module into the slot at `port`.
    ///
    /// # Errors
    ///
    /// [`f103::Error::Powered`] while the power is on, [`Error::Slot`] if the board has no such slot.
    pub fn set_module_at(&mut self, port: u8, module: Module) -> Result<(), Error> {
        if self.powered() {
            return Err(f103::Error::Powered.into());
        }
        self.change_slot(port, |slot| slot.set_module(module))
    }

    /// Energises the digital input of channel `ch` (1 to 4) of the first slot, or removes the voltage.
    ///
    /// # Errors
    ///
    /// [`Error::Channel`] if this channel is not a digital input.
    pub fn set_energised(&mut self, ch: usize, energised: bool) -> Result<(), Error> {
        self.with_slot(|slot| slot.set_energised(ch, energised))
    }

    /// Sets the jumper of relay `ch` (1 or 2) of the first slot to manual or to automatic.
    ///
    /// # Errors
    ///
    /// [`Error::Channel`] if this channel is not a relay.
    pub fn set_manual(&mut self, ch: usize, manual: bool) -> Result<(), Error> {
        self.with_slot(|slot| slot.set_manual(ch, manual))
    }

    /// Sets the voltage at the pin of the analog input of channel `ch` (1 to 4) of the first slot, 0 to 3300 mV.
    ///
    /// # Errors
    ///
    /// [`Error::Channel`] if this channel is not an analog input, [`Error::Range`] above 3300 mV.
    pub fn set_millivolts(&mut self, ch: usize, millivolts: u16) -> Result<(), Error> {
        self.with_slot(|slot| slot.set_millivolts(ch, millivolts))
    }

    /// Sets the source impedance of the analog input of channel `ch` (1 to 4) of the first slot, in ohms.
    ///
    /// # Errors
    ///
    /// [`Error::Channel`] if this channel is not an analog input.
    pub fn set_source_ohms(&mut self, ch: usize, ohms: u32) -> Result<(), Error> {
        self.with_slot(|slot| slot.set_source_ohms(ch, ohms))
    }

    /// Causes or clears a fault of the I2C bus in the first slot.
    pub fn set_bus_fault(&mut self, fault: BusFault) {
        // A board without a slot has no DAC that could fail.
        let _ = self.with_slot(|slot| {
            slot.set_bus_fault(fault);
            Ok(())
        });
    }

    /// Returns the state of channel `ch` (1 to 4) of the first slot; [`Channel::None`] for any other number.
    #[must_use]
    pub fn channel(&self, ch: usize) -> Channel {
        let slot = self.circuit().slots.first();
        slot.map_or(Channel::None, |slot| slot.channel(ch))
    }

    /// Returns the first slot, for reading.
    ///
    /// # Panics
    ///
    /// If the board has no slot.
    #[must_use]
    pub fn slot(&self) -> &Slot {
        &self.circuit().slots[0]
    }

    /// Returns the slots with the numbers of their ports, in order.
    pub fn slots(&self) -> impl Iterator<Item = (u8, &Slot)> {
        let ports = self.layout().slots.iter().map(|pins| pins.port);
        ports.zip(&self.circuit().slots)
    }

    /// Changes the slot at `port` at this instant. The part sees the change immediately.
    ///
    /// # Errors
    ///
    /// [`Error::Slot`] if the board has no such slot.
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

    fn with_slot(
        &mut self,
        action: impl FnOnce(&mut Slot) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.change_slot(self.first_port(), action)?
    }

    /// Returns the terminals with their states.
    #[must_use]
    pub fn terminals(&self) -> &Terminals {
        &self.circuit().terminals
    }

    /// Applies `value` to the terminal `name` at this instant.
    ///
    /// # Errors
    ///
    /// As [`Terminals::set`].
    pub fn set_terminal(&mut self, name: &str, value: Value) -> Result<(), Error> {
        self.change(|circuit| circuit.terminals.set(name, value))
    }

    /// Returns the RS-232 port; `None` if the board has none.
    pub fn rs232(&mut self) -> Option<&mut Rs232> {
        self.sync();
        self.circuit_mut().rs232.as_mut()
    }

    /// Returns the LEDs.
    #[must_use]
    pub fn leds(&self) -> Leds {
        // A pin that is not an output lights no LED, whatever its level is.
        let lit = |led: Led| {
            let (port, number) = (led.pin.port(), led.pin.number() as u8);
            let high = self.pin(port, number);
            self.powered() && self.is_output(port, number) && high == led.lit_by
        };
        let leds = &self.layout().leds;
        Leds {
            activity: leds.activity.is_some_and(lit),
            fault: leds.fault.is_some_and(lit),
            run: lit(leds.run),
        }
    }

    /// Returns whether the RS-485 driver is on.
    #[must_use]
    pub fn driver_enable(&self) -> bool {
        self.circuit().line.driver()
    }

    /// Returns the number of writes to the data register of the line's USART since the last reset: one for each byte that the firmware
    /// sends.
    #[must_use]
    pub fn line_bytes_written(&self) -> u64 {
        self.usart(self.layout().line.tx).data_writes()
    }

    /// Returns the RS-485 line, for sending and for reading the record.
    pub fn line(&mut self) -> &mut Line {
        self.sync();
        &mut self.circuit_mut().line
    }

    /// Returns the LoRa module; `None` if the board has none.
    #[must_use]
    pub fn radio(&self) -> Option<&radio::Module> {
        self.circuit().radio.as_ref().map(|radio| &radio.module)
    }

    /// Changes the LoRa module at this instant. The part sees the change immediately. `None` if the board has no
    /// module.
    pub fn change_radio<T>(&mut self, action: impl FnOnce(&mut radio::Module) -> T) -> Option<T> {
        self.change(|circuit| {
            circuit
                .radio
                .as_mut()
                .map(|radio| action(&mut radio.module))
        })
    }

    /// Causes or ends a fault of the LoRa module at this instant. Does nothing if the board has no module.
    pub fn set_radio_fault(&mut self, fault: radio::Fault) {
        self.change_radio(|module| module.set_fault(fault));
    }

    /// Returns the air with the gateway radio. `None` if the board has no LoRa module, or is on a bus with other
    /// boards: see [`Bus::air`](crate::Bus::air).
    pub fn air(&mut self) -> Option<&mut Air> {
        self.sync();
        let now = self.now();
        let radio = self.circuit_mut().radio.as_mut();
        let air = radio.and_then(|radio| radio.air.as_mut())?;
        air.set_earliest(now);
        Some(air)
    }
}
