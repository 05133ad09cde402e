//! Alternate-function I/O, RM0008 section 9.4: the port that feeds each EXTI line, and the debug port's pins.
//!
//! Pin remapping is not modelled: every peripheral is on its default pins.

use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

/// SWJ_CFG, write-only (RM0008 9.4.2).
const MAPR_SWJ_CFG: u32 = 0b111 << 24;

/// The bits that each EXTICR keeps, read back from two boards after all ones were written (labwired-core,
/// stm32f1_mmio_diff.rs).
const EXTICR: u32 = 0x7FFF;

/// The AFIO registers.
#[derive(Debug, Default)]
pub struct Afio {
    exticr: [u32; 4],
}

impl Afio {
    /// Returns the port that feeds EXTI line `line` (0 to 15): 0 = A, 1 = B, ...
    #[must_use]
    pub fn exti_port(&self, line: usize) -> usize {
        (self.exticr[line / 4] >> (4 * (line % 4)) & 0xF) as usize
    }
}

impl Peripheral for Afio {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        match offset {
            0x00 => Err(Unmodelled("AFIO_EVCR, the event output")),
            0x04 => Ok(0),
            0x08..=0x14 => Ok(self.exticr[(offset as usize - 8) / 4]),
            _ => Err(Unmodelled("a reserved address of AFIO")),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _now: Time) -> Result<(), Unmodelled> {
        match offset {
            0x04 if value & !MAPR_SWJ_CFG == 0 => Ok(()),
            0x04 => Err(Unmodelled("pin remapping (AFIO_MAPR)")),
            0x08..=0x14 => {
                self.exticr[(offset as usize - 8) / 4] = value & EXTICR;
                Ok(())
            }
            0x00 => Err(Unmodelled("AFIO_EVCR, the event output")),
            _ => Err(Unmodelled("a reserved address of AFIO")),
        }
    }

    fn reset(&mut self, _now: Time) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exti_lines_follow_exticr_and_remaps_are_refused() {
        let mut afio = Afio::default();
        afio.write(0x0C, 0x0021, Time::ZERO).unwrap();
        assert_eq!((afio.exti_port(4), afio.exti_port(5)), (1, 2));
        assert_eq!(afio.write(4, 2 << 24, Time::ZERO), Ok(()));
        assert!(afio.write(4, 1 << 2, Time::ZERO).is_err(), "USART1 remap");
    }
}
