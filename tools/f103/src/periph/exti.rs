//! External interrupts, RM0008 chapter 10: edges on pins and the software trigger set pending bits.
//!
//! Event mode (EMR) and the internal lines 16 to 19 are not modelled.

use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

/// Lines 0 to 15, the pins.
const PINS: u32 = 0xFFFF;
const INTERNAL: &str = "the internal EXTI lines 16 to 19";

/// The EXTI registers.
#[derive(Debug, Default)]
pub struct Exti {
    imr: u32,
    rtsr: u32,
    ftsr: u32,
    swier: u32,
    pr: u32,
}

impl Exti {
    /// Takes a change of the pins: the lines in `changed`, and the levels after the change, one bit for each line.
    pub fn pins(&mut self, changed: u16, level: u16) {
        let (changed, level) = (u32::from(changed), u32::from(level));
        self.pr |= changed & (level & self.rtsr | !level & self.ftsr);
    }

    /// Returns whether any line detects edges.
    #[must_use]
    pub fn listens(&self) -> bool {
        self.rtsr | self.ftsr != 0
    }

    /// Returns whether a line detects edges.
    #[must_use]
    pub fn detects(&self, line: usize) -> bool {
        (self.rtsr | self.ftsr) >> line & 1 != 0
    }

    /// Returns the lines that request an interrupt, one bit each.
    #[must_use]
    pub fn requests(&self) -> u32 {
        self.pr & self.imr
    }
}

impl Peripheral for Exti {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        Ok(match offset {
            0x00 => self.imr,
            0x04 => 0,
            0x08 => self.rtsr,
            0x0C => self.ftsr,
            0x10 => self.swier,
            0x14 => self.pr,
            _ => return Err(Unmodelled("a reserved address of EXTI")),
        })
    }

    fn write(&mut self, offset: u32, value: u32, _now: Time) -> Result<(), Unmodelled> {
        let pins = value & PINS;
        match offset {
            0x00 => self.imr = pins,
            0x04 if value == 0 => {}
            0x04 => return Err(Unmodelled("EXTI_EMR, event mode")),
            0x08 => self.rtsr = pins,
            0x0C => self.ftsr = pins,
            0x10 => {
                // Only a bit going from 0 to 1 triggers (RM0008 10.3.5).
                self.pr |= pins & !self.swier;
                self.swier |= pins;
            }
            0x14 => {
                self.pr &= !pins;
                self.swier &= !pins;
            }
            _ => return Err(Unmodelled("a reserved address of EXTI")),
        }
        if value & !PINS != 0 && offset != 0x14 {
            return Err(Unmodelled(INTERNAL));
        }
        Ok(())
    }

    fn irq(&self) -> bool {
        self.requests() != 0
    }

    fn reset(&mut self, _now: Time) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn software_trigger_sets_pending_once_until_it_is_cleared() {
        let mut exti = Exti::default();
        exti.write(0, 1 << 3, Time::ZERO).unwrap();
        exti.write(0x10, 1 << 3, Time::ZERO).unwrap();
        assert_eq!((exti.requests(), exti.read(0x10, Time::ZERO)), (8, Ok(8)));
        exti.write(0x14, 1 << 3, Time::ZERO).unwrap();
        assert_eq!((exti.requests(), exti.read(0x10, Time::ZERO)), (0, Ok(0)));
        exti.write(0x10, 1 << 3, Time::ZERO).unwrap();
        assert_eq!(exti.requests(), 8);
        assert!(exti.write(4, 1, Time::ZERO).is_err(), "event mode");
        assert!(exti.write(0, 1 << 16, Time::ZERO).is_err(), "the detector");
    }

    #[test]
    fn only_the_chosen_edge_sets_pending_and_writing_one_clears_it() {
        let mut exti = Exti::default();
        exti.write(0x0C, 1 << 5, Time::ZERO).unwrap();
        exti.pins(1 << 5, 1 << 5);
        assert_eq!(exti.read(0x14, Time::ZERO), Ok(0));
        exti.pins(1 << 5, 0);
        assert_eq!(exti.read(0x14, Time::ZERO), Ok(1 << 5));
        assert!(!exti.irq(), "masked");
        exti.write(0, 1 << 5, Time::ZERO).unwrap();
        assert_eq!(exti.requests(), 1 << 5);
        exti.write(0x14, 1 << 5, Time::ZERO).unwrap();
        assert!(!exti.irq());
    }
}
