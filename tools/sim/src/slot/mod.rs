//! A slot: the module in it, and what is connected to the channels of the module.
//!
//! Four lines lead from the slot to the part's pins, one for each point of the module. Modules with analog outputs are
//! also connected to I2C1. The kind of a point defines its line, so that a new module needs no code here:
//!
//! | point | line |
//! |---|---|
//! | bit input | low while the input is energised, else floating |
//! | bit output | line high = the transistor conducts |
//! | bits of a 2Relay | lines 1, 2: jumper of relay 1, 2, low = manual; lines 3, 4: coil, high = energised |
//! | analog input | the voltage at the pin |
//! | analog output | none: output A, B, C or D of an MCP4728 on I2C |

mod channel;
pub mod mcp4728;

#[cfg(test)]
mod tests;

pub use channel::{Channel, MAX_MILLIVOLTS};
use mcp4728::{Mcp4728, Setting};
use register_map::Module;

use crate::error::Error;
use register_map::points::Kind;

use f103::periph::gpio::Drive;
use f103::periph::i2c::{Bus, Wires};
use f103::time::Time;

/// Default source impedance of an analog input, in ohms. It is more than that of the range with the highest impedance:
/// the thermistor at 25 degrees Celsius with its pull-up has 5 kOhm.
const SOURCE_OHMS: u32 = 10_000;

/// A fault of the DAC or of the I2C wires.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BusFault {
    /// No fault.
    #[default]
    None,
    /// The DAC does not answer its address.
    Absent,
    /// A device holds the clock low.
    HoldsScl,
    /// A device holds the data wire low, because it has counted the clock pulses wrongly.
    HoldsSda {
        /// Number of clock pulses, made with the pin as a GPIO output, after which the device releases the data wire.
        /// `None` if it never does.
        clocks: Option<u8>,
    },
}

/// A slot and the module in it.
#[derive(Clone, Debug)]
pub struct Slot {
    module: Module,
    powered: bool,
    energised: [bool; 4],
    manual: [bool; 2],
    millivolts: [u16; 4],
    source_ohms: [u32; 4],
    /// Level that the part drives at each line; low for a line that it does not drive.
    driven: [bool; 4],
    dac: Mcp4728,
    dac_address: u8,
    fault: BusFault,
    /// Levels of the I2C pins as GPIO outputs.
    pins: Wires,
}

impl Default for Slot {
    fn default() -> Self {
        Self::new(Module::None)
    }
}

impl Slot {
    /// Returns a slot with `module` in it, with its power on and nothing applied to its inputs.
    #[must_use]
    pub fn new(module: Module) -> Self {
        Self {
            module,
            powered: true,
            energised: [false; 4],
            manual: [false; 2],
            millivolts: [0; 4],
            source_ohms: [SOURCE_OHMS; 4],
            driven: [false; 4],
            dac: Mcp4728::default(),
            dac_address: mcp4728::ADDRESS,
            fault: BusFault::None,
            pins: Wires::FREE,
        }
    }

    /// Returns the same slot, with the DAC of its modules at the I2C address `address`, 0x60 to 0x67.
    #[must_use]
    pub fn with_dac_at(self, address: u8) -> Self {
        Self {
            dac: self.dac.at(address),
            dac_address: address,
            ..self
        }
    }

    /// Returns the module in the slot.
    #[must_use]
    pub const fn module(&self) -> Module {
        self.module
    }

    /// Plugs a new module into the slot. Nothing is applied to its inputs, and its DAC is in the state of delivery.
    pub fn set_module(&mut self, module: Module) {
        *self = Self {
            powered: self.powered,
            ..Self::new(module).with_dac_at(self.dac_address)
        };
    }

    /// Switches the board's power. What is applied to the inputs stays; the DAC starts with the values in its EEPROM.
    pub fn set_power(&mut self, on: bool, _now: Time) {
        if on && !self.powered {
            self.dac.power_on();
        }
        if !on {
            self.driven = [false; 4];
            self.pins = Wires::FREE;
        }
        self.powered = on;
    }

    /// Returns the state of channel `ch` (1 to 4); [`Channel::None`] for any other number.
    #[must_use]
    pub fn channel(&self, ch: usize) -> Channel {
        if !(1..=4).contains(&ch) {
            return Channel::None;
        }
        let n = ch - 1;
        match (self.module, self.module.points()[n]) {
            // A relay has two points: its jumper and its coil.
            (Module::Relay2, Kind::BitInput) => Channel::Relay {
                energised: self.powered && self.driven[n + 2],
                manual: self.manual[n],
            },
            (Module::Relay2, _) | (_, Kind::None) => Channel::None,
            (_, Kind::BitInput) => Channel::Di {
                energised: self.energised[n],
            },
            (_, Kind::BitOutput) => Channel::Do {
                on: self.powered && self.driven[n],
            },
            (_, Kind::WordInput) => Channel::Ai {
                millivolts: self.millivolts[n],
            },
            (_, Kind::WordOutput) => Channel::Ao {
                code: if self.powered { self.dac.output(n) } else { 0 },
            },
        }
    }

    /// Energises the digital input of channel `ch` (1 to 4), or removes the voltage.
    ///
    /// # Errors
    ///
    /// [`Error::Channel`] if this channel is not a digital input.
    pub fn set_energised(&mut self, ch: usize, energised: bool) -> Result<(), Error> {
        match self.channel(ch) {
            Channel::Di { .. } => self.energised[ch - 1] = energised,
            _ => return Err(Error::Channel),
        }
        Ok(())
    }

    /// Sets the jumper of relay `ch` (1 or 2) to manual or to automatic.
    ///
    /// # Errors
    ///
    /// [`Error::Channel`] if this channel is not a relay.
    pub fn set_manual(&mut self, ch: usize, manual: bool) -> Result<(), Error> {
        match self.channel(ch) {
            Channel::Relay { .. } => self.manual[ch - 1] = manual,
            _ => return Err(Error::Channel),
        }
        Ok(())
    }

    /// Sets the voltage at the pin of the analog input of channel `ch` (1 to 4), 0 to 3300 mV.
    ///
    /// # Errors
    ///
    /// [`Error::Channel`] if this channel is not an analog input, [`Error::Range`] above 3300 mV.
    pub fn set_millivolts(&mut self, ch: usize, millivolts: u16) -> Result<(), Error> {
        match self.channel(ch) {
            Channel::Ai { .. } if millivolts > MAX_MILLIVOLTS => {
                return Err(Error::Range("an analog input takes 0 to 3300 mV"));
            }
            Channel::Ai { .. } => self.millivolts[ch - 1] = millivolts,
            _ => return Err(Error::Channel),
        }
        Ok(())
    }

    /// Sets the source impedance of the analog input of channel `ch` (1 to 4), in ohms.
    ///
    /// # Errors
    ///
    /// [`Error::Channel`] if this channel is not an analog input.
    pub fn set_source_ohms(&mut self, ch: usize, ohms: u32) -> Result<(), Error> {
        match self.channel(ch) {
            Channel::Ai { .. } => self.source_ohms[ch - 1] = ohms,
            _ => return Err(Error::Channel),
        }
        Ok(())
    }

    /// Returns the source impedance at line `line` (1 to 4), in ohms.
    #[must_use]
    pub fn source_ohms(&self, line: usize) -> u32 {
        let ohms = line.checked_sub(1).and_then(|n| self.source_ohms.get(n));
        ohms.copied().unwrap_or(SOURCE_OHMS)
    }

    /// Returns what the module drives at line `line` (1 to 4).
    #[must_use]
    pub fn drive(&self, line: usize) -> Drive {
        let pulls = |low| if low { Drive::Low } else { Drive::Floating };
        match self.channel(line) {
            Channel::Di { energised } => pulls(energised),
            Channel::Relay { manual, .. } => pulls(manual),
            Channel::Ai { millivolts } => Drive::Millivolts(millivolts),
            Channel::None | Channel::Do { .. } | Channel::Ao { .. } => Drive::Floating,
        }
    }

    /// Takes over the level that the part drives at line `line` (1 to 4); low for a pin that is not an output. Any
    /// other line is ignored.
    pub fn set_line(&mut self, line: usize, high: bool) {
        if let Some(driven) = line.checked_sub(1).and_then(|n| self.driven.get_mut(n)) {
            *driven = high;
        }
    }

    /// Returns whether the module has a DAC on I2C1.
    #[must_use]
    pub fn has_dac(&self) -> bool {
        self.module.points().contains(&Kind::WordOutput)
    }

    /// Returns the four input registers of the DAC, and the four settings in its EEPROM, A to D.
    #[must_use]
    pub const fn dac(&self) -> ([Setting; 4], [Setting; 4]) {
        (self.dac.registers(), self.dac.eeprom())
    }

    /// Causes a fault of the DAC or of the I2C wires, or clears it with [`BusFault::None`].
    pub const fn set_bus_fault(&mut self, fault: BusFault) {
        self.fault = fault;
    }

    /// Returns the fault of the DAC or of the I2C wires.
    #[must_use]
    pub const fn bus_fault(&self) -> BusFault {
        self.fault
    }

    /// Takes over the levels of the I2C pins as GPIO outputs, `true` = not pulled low; [`Wires::FREE`] while they are
    /// pins of the I2C block. Clock pulses on them free a stuck data wire. Returns whether the pins have changed.
    pub fn set_pins(&mut self, pins: Wires) -> bool {
        if pins == self.pins {
            return false;
        }
        let rises = pins.scl && !self.pins.scl;
        self.pins = pins;
        if let BusFault::HoldsSda {
            clocks: Some(clocks),
        } = &mut self.fault
            && rises
        {
            *clocks = clocks.saturating_sub(1);
            if *clocks == 0 {
                self.fault = BusFault::None;
            }
        }
        true
    }

    /// Returns the levels of the I2C wires as the devices hold them, without the part's own outputs.
    #[must_use]
    pub fn held(&self) -> Wires {
        Wires {
            scl: self.fault != BusFault::HoldsScl,
            sda: !matches!(self.fault, BusFault::HoldsSda { .. }),
        }
    }

    fn answers(&self) -> bool {
        self.powered && self.has_dac() && !matches!(self.fault, BusFault::Absent)
    }
}

impl Bus for Slot {
    fn wires(&self) -> Wires {
        let held = self.held();
        Wires {
            scl: held.scl && self.pins.scl,
            sda: held.sda && self.pins.sda,
        }
    }

    fn address(&mut self, byte: u8, now: Time) -> bool {
        self.answers() && self.dac.address(byte, now)
    }

    fn write(&mut self, byte: u8, now: Time) -> bool {
        self.answers() && self.dac.write(byte, now)
    }

    fn read(&mut self, now: Time) -> u8 {
        if self.answers() {
            self.dac.read(now)
        } else {
            0xFF
        }
    }

    fn stop(&mut self, now: Time) {
        if self.answers() {
            self.dac.stop(now);
        }
    }
}
