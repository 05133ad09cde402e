//! One GPIO port, RM0008 chapter 9: the levels that the part drives and reads at its sixteen pins.
//!
//! An alternate-function output stays at its idle level, high, for USART and I2C alike. Their traffic is modelled
//! character by character on the line and byte by byte on the I2C bus, not edge by edge here.
//! Levels are calculated for the whole port together, as bit masks. A pin that is driven neither inside nor
//! outside reads low. A real floating pin reads either level; low is the worst case for an active-low input.

mod lock;

use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

/// How the circuit outside the part drives a pin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Drive {
    /// Not driven: open.
    #[default]
    Floating,
    /// Held low, as a closed switch to ground does.
    Low,
    /// Held high.
    High,
    /// A resistor to 3.3 V.
    PullUp,
    /// A voltage in millivolts, 0 to 3300.
    Millivolts(u16),
}

/// Lowest voltage that a digital input reads as high: between VIL and VIH (DS5319 table 35), at half the supply.
const THRESHOLD_MV: u16 = 1650;
const CRL_RESET: u32 = 0x4444_4444;

/// A port's registers and pins.
#[derive(Debug)]
pub struct Gpio {
    crl: u32,
    crh: u32,
    odr: u16,
    lckr: u32,
    /// Progress of the LCKR key sequence (RM0008 9.2.7): 0 to 3.
    lock_step: u8,
    modes: Modes,
    drives: [Drive; 16],
    outside: Outside,
    level: u16,
    contention: u16,
    watched: u16,
    /// Pins whose outputs may not be faster than 2 MHz, one bit each.
    slow: u16,
    debug: DebugPins,
    /// Voltage of the DAC's output at each pin that has one and is analog, in millivolts.
    dac: [Option<u16>; 16],
    edges: [Vec<(Time, bool)>; 16],
}

/// Pins by their mode, one bit each.
#[derive(Clone, Copy, Debug, Default)]
struct Modes {
    output: u16,
    open_drain: u16,
    alternate: u16,
    analog: u16,
    pulled: u16,
}

/// Pins that the debug port owns, whatever the port's registers say (RM0008 9.3.5), one bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DebugPins {
    /// All of them.
    pub owned: u16,
    /// Pins with a pull-up.
    pub up: u16,
    /// Pins with a pull-down.
    pub down: u16,
}

/// Pins by how the outside drives them, one bit each.
#[derive(Clone, Copy, Debug, Default)]
struct Outside {
    low: u16,
    high: u16,
    pull_up: u16,
}

impl Default for Gpio {
    fn default() -> Self {
        Self {
            crl: CRL_RESET,
            crh: CRL_RESET,
            odr: 0,
            lckr: 0,
            lock_step: 0,
            modes: Modes::default(),
            drives: [Drive::Floating; 16],
            outside: Outside::default(),
            level: 0,
            contention: 0,
            watched: 0,
            slow: 0,
            debug: DebugPins::default(),
            dac: [None; 16],
            edges: Default::default(),
        }
    }
}

impl Gpio {
    /// Returns a port whose pins in `slow`, one bit each, may not be faster than 2 MHz as outputs.
    #[must_use]
    pub fn with_slow_pins(slow: u16) -> Self {
        Self {
            slow,
            ..Self::default()
        }
    }

    /// Returns whether a pin that has to be slow is an output at 10 or 50 MHz.
    fn is_too_fast(&self) -> bool {
        (0..16).filter(|pin| self.slow >> pin & 1 != 0).any(|pin| {
            let register = if pin < 8 { self.crl } else { self.crh };
            register >> (4 * (pin % 8)) & 1 != 0
        })
    }

    /// Returns the levels at the pins, as a logic probe shows them, one bit each.
    #[must_use]
    pub fn level(&self) -> u16 {
        self.level
    }

    /// Returns the pins that are outputs, one bit each.
    #[must_use]
    pub fn outputs(&self) -> u16 {
        self.modes.output
    }

    /// Sets the pins that the debug port owns.
    pub fn set_debug(&mut self, pins: DebugPins, now: Time) {
        if pins != self.debug {
            self.debug = pins;
            self.decode();
            self.settle(now);
        }
    }

    /// Sets the voltage of the DAC's output at `pin` in millivolts; `None` while the output is off.
    pub fn set_dac(&mut self, pin: usize, millivolts: Option<u16>) {
        self.dac[pin] = millivolts;
    }

    /// Returns the voltage of the DAC's output at `pin` in millivolts; `None` while the output is off, or the pin is not
    /// analog.
    #[must_use]
    pub fn dac(&self, pin: usize) -> Option<u16> {
        self.dac[pin].filter(|_| self.modes.analog >> pin & 1 != 0)
    }

    /// Returns the levels that outputs and pulls give their pins, one bit each.
    fn value(&self) -> u16 {
        self.odr & !self.debug.owned | self.debug.up | self.modes.alternate
    }

    /// Returns the pins handed to a peripheral's output (alternate function), one bit each.
    #[must_use]
    pub fn alternate_outputs(&self) -> u16 {
        self.modes.alternate & self.modes.output
    }

    /// Returns the pins handed to a peripheral's output as open drain, one bit each.
    #[must_use]
    pub fn alternate_open_drains(&self) -> u16 {
        self.alternate_outputs() & self.modes.open_drain
    }

    /// Returns the pins that the firmware itself pulls low as plain outputs, one bit each.
    #[must_use]
    pub fn pulled_low(&self) -> u16 {
        self.modes.output & !self.modes.alternate & !self.odr
    }

    /// Returns the level the part itself gives `pin`, as an output or by a pull; `None` when it leaves the pin open.
    #[must_use]
    pub fn held(&self, pin: usize) -> Option<bool> {
        let bit = 1 << pin;
        let high = self.value() & bit != 0;
        let released = self.modes.open_drain & bit != 0 && high;
        let held = self.modes.output & bit != 0 && !released || self.modes.pulled & bit != 0;
        held.then_some(high)
    }

    /// Returns the pins in analog mode, one bit each.
    #[must_use]
    pub fn analog(&self) -> u16 {
        self.modes.analog
    }

    /// Returns the voltage at a pin, in millivolts.
    #[must_use]
    pub fn millivolts(&self, pin: usize) -> u16 {
        match self.drives[pin] {
            Drive::Millivolts(mv) => mv,
            _ if self.level >> pin & 1 != 0 => 3300,
            _ => 0,
        }
    }

    /// Returns the pins that the part and the outside drive against each other, since the last call.
    pub fn take_contention(&mut self) -> u16 {
        core::mem::take(&mut self.contention)
    }

    /// Changes how the outside drives `pin` (0 to 15).
    pub fn drive(&mut self, pin: usize, drive: Drive, now: Time) {
        if self.drives[pin] == drive {
            return;
        }
        self.drives[pin] = drive;
        let bit = 1 << pin;
        let outside = &mut self.outside;
        outside.low &= !bit;
        outside.high &= !bit;
        outside.pull_up &= !bit;
        match drive {
            Drive::Floating => {}
            Drive::Low => outside.low |= bit,
            Drive::High => outside.high |= bit,
            Drive::PullUp => outside.pull_up |= bit,
            Drive::Millivolts(mv) if mv >= THRESHOLD_MV => outside.high |= bit,
            Drive::Millivolts(_) => outside.low |= bit,
        }
        self.settle(now);
    }

    /// Records the edges of `pin` (0 to 15) from now on.
    pub fn watch(&mut self, pin: usize) {
        self.watched |= 1 << pin;
    }

    /// Returns the recorded edges of `pin` (0 to 15).
    #[must_use]
    pub fn edges(&self, pin: usize) -> &[(Time, bool)] {
        &self.edges[pin]
    }

    /// Calculates the levels again.
    fn settle(&mut self, now: Time) {
        let Modes {
            output,
            open_drain,
            pulled,
            ..
        } = self.modes;
        let value = self.value();
        let strong_low = output & !value;
        let strong_high = output & !open_drain & value;
        let Outside { low, high, pull_up } = self.outside;
        self.contention |= strong_high & low | strong_low & high;
        let held_low = strong_low | low;
        let held_high = (strong_high | high) & !held_low;
        let weak = pull_up | pulled & value;
        let level = held_high | weak & !held_low;
        let changed = level ^ self.level;
        self.level = level;
        let mut recorded = changed & self.watched;
        while recorded != 0 {
            let pin = recorded.trailing_zeros() as usize;
            recorded &= recorded - 1;
            self.edges[pin].push((now, level >> pin & 1 != 0));
        }
    }

    /// Decodes CRL and CRH (RM0008 table 20).
    fn decode(&mut self) {
        let mut modes = Modes::default();
        for pin in 0..16 {
            let register = if pin < 8 { self.crl } else { self.crh };
            let nibble = register >> (4 * (pin % 8)) & 0xF;
            let (mode, cnf, bit) = (nibble & 3, nibble >> 2, 1u16 << pin);
            if mode == 0 {
                match cnf {
                    0 => modes.analog |= bit,
                    2 => modes.pulled |= bit,
                    _ => {}
                }
            } else {
                modes.output |= bit;
                if cnf & 1 != 0 {
                    modes.open_drain |= bit;
                }
                if cnf & 2 != 0 {
                    modes.alternate |= bit;
                }
            }
        }
        let DebugPins { owned, up, down } = self.debug;
        let free = !owned;
        self.modes = Modes {
            output: modes.output & free,
            open_drain: modes.open_drain & free,
            alternate: modes.alternate & free,
            analog: modes.analog & free,
            pulled: modes.pulled & free | up | down,
        };
    }
}

impl Peripheral for Gpio {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        Ok(match offset {
            0x00 => self.crl,
            0x04 => self.crh,
            // In analog mode the Schmitt trigger is off and reads 0 (RM0008 9.1.12).
            0x08 => u32::from(self.level & !self.modes.analog),
            0x0C => u32::from(self.odr),
            // BSRR and BRR are write-only.
            0x10 | 0x14 => 0,
            0x18 => self.read_lckr(),
            _ => return Err(Unmodelled("a reserved address of GPIO")),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: Time) -> Result<(), Unmodelled> {
        match offset {
            0x00 | 0x04 => {
                let first = if offset == 0 { 0 } else { 8 };
                let locked = self.locked(first);
                let register = if offset == 0 {
                    &mut self.crl
                } else {
                    &mut self.crh
                };
                *register = value & !locked | *register & locked;
                self.decode();
            }
            0x08 => return Ok(()),
            0x0C => self.odr = value as u16,
            // Set wins over reset (RM0008 9.2.5).
            0x10 => self.odr = self.odr & !((value >> 16) as u16) | value as u16,
            0x14 => self.odr &= !(value as u16),
            0x18 => {
                self.write_lckr(value);
                return Ok(());
            }
            _ => return Err(Unmodelled("a reserved address of GPIO")),
        }
        self.settle(now);
        if offset <= 0x04 && self.is_too_fast() {
            return Err(Unmodelled("PC13 to PC15 faster than 2 MHz"));
        }
        Ok(())
    }

    fn reset(&mut self, now: Time) {
        self.crl = CRL_RESET;
        self.crh = CRL_RESET;
        self.odr = 0;
        self.lckr = 0;
        self.lock_step = 0;
        self.decode();
        self.settle(now);
    }
}

#[cfg(test)]
mod tests;
