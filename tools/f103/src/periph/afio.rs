//! Alternate-function I/O, RM0008 section 9.4: the port that feeds each EXTI line, and the debug port's pins.
//!
//! Of the remaps only those of the USARTs are modelled, and that of CAN, whose traffic is not modelled: every other
//! peripheral is on its default pins.

use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

/// SWJ_CFG, write-only (RM0008 9.4.2).
const MAPR_SWJ_CFG: u32 = 0b111 << 24;
/// CAN_REMAP (RM0008 9.4.2).
const MAPR_CAN_REMAP: u32 = 0b11 << 13;
/// USART1_REMAP, USART2_REMAP and USART3_REMAP (RM0008 9.4.2).
const MAPR_USART_REMAPS: u32 = 0b11_1100;
const MAPR_USART3_REMAP: u32 = 0b11 << 4;
/// The value of USART3_REMAP that means nothing.
const NO_USART3_REMAP: u32 = 0b10 << 4;

/// The bits that each EXTICR keeps, read back from two boards after all ones were written (labwired-core,
/// stm32f1_mmio_diff.rs).
const EXTICR: u32 = 0x7FFF;

/// The AFIO registers.
#[derive(Debug, Default)]
pub struct Afio {
    exticr: [u32; 4],
    mapr: u32,
    /// SWJ_CFG.
    debug: u32,
}

impl Afio {
    /// Returns the pins of ports A and B that the debug port owns, one bit each (RM0008 table 35).
    #[must_use]
    pub const fn debug_pins(&self) -> [u16; 2] {
        const JTDI: u16 = 1 << 15;
        const SW_DP: u16 = 0b11 << 13;
        const JTDO: u16 = 1 << 3;
        const NJTRST: u16 = 1 << 4;
        match self.debug {
            1 => [JTDI | SW_DP, JTDO],
            2 => [SW_DP, 0],
            4 => [0, 0],
            _ => [JTDI | SW_DP, JTDO | NJTRST],
        }
    }

    /// Returns AFIO_MAPR without SWJ_CFG.
    #[must_use]
    pub const fn mapr(&self) -> u32 {
        self.mapr
    }

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
            // SWJ_CFG is write-only. A real part returns any value there; zeros show firmware that writes back what
            // it has read.
            0x04 => Ok(self.mapr),
            0x08..=0x14 => Ok(self.exticr[(offset as usize - 8) / 4]),
            _ => Err(Unmodelled("a reserved address of AFIO")),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _now: Time) -> Result<(), Unmodelled> {
        match offset {
            0x04 => {
                const KNOWN: u32 = MAPR_CAN_REMAP | MAPR_USART_REMAPS;
                self.mapr = value & KNOWN;
                self.debug = (value & MAPR_SWJ_CFG) >> 24;
                if value & !(MAPR_SWJ_CFG | KNOWN) != 0
                    || value & MAPR_USART3_REMAP == NO_USART3_REMAP
                {
                    return Err(Unmodelled("pin remapping (AFIO_MAPR)"));
                }
                Ok(())
            }
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
        for refused in [1 << 6, 1 << 8, NO_USART3_REMAP] {
            assert!(afio.write(4, refused, Time::ZERO).is_err(), "{refused:#x}");
        }
        afio.write(4, 0b01_1100, Time::ZERO).unwrap();
        assert_eq!(afio.read(4, Time::ZERO), Ok(0b01_1100), "USARTs");
    }

    #[test]
    fn every_write_of_mapr_sets_the_pins_of_the_debug_port() {
        let mut afio = Afio::default();
        assert_eq!(afio.debug_pins(), [0xE000, 0x18]);
        for (configuration, pins) in [(1, [0xE000, 8]), (2, [0x6000, 0]), (4, [0, 0])] {
            afio.write(4, configuration << 24, Time::ZERO).unwrap();
            assert_eq!(afio.debug_pins(), pins);
            assert_eq!(afio.read(4, Time::ZERO), Ok(0), "write-only");
        }
        afio.write(4, MAPR_CAN_REMAP, Time::ZERO).unwrap();
        assert_eq!(afio.read(4, Time::ZERO), Ok(MAPR_CAN_REMAP));
        assert_eq!(afio.debug_pins(), [0xE000, 0x18]);
    }
}
