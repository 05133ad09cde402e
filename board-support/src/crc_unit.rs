//! The CRC unit, which computes the CRC-32 of an image (RM0008 4).

use stm32f1xx_hal::{pac, rcc::Enable};

/// The CRC unit, with its clock on.
pub struct CrcUnit(pac::CRC);

impl CrcUnit {
    pub(crate) fn new(crc: pac::CRC, rcc: &mut pac::RCC) -> Self {
        pac::CRC::enable(rcc);
        Self(crc)
    }

    /// Returns the CRC-32 of parts whose bytes are multiples of 4, one after the other, in little-endian words.
    pub fn of(&mut self, parts: [&[u8]; 2]) -> u32 {
        self.0.cr().write(|w| w.reset().set_bit());
        for part in parts {
            for word in part.as_chunks().0 {
                let word = u32::from_le_bytes(*word);
                self.0.dr().write(|w| w.dr().set(word));
            }
        }
        self.0.dr().read().dr().bits()
    }
}
