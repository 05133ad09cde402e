//! The CRC unit, RM0008 chapter 4.

use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

const POLYNOMIAL: u32 = 0x04C1_1DB7;
const CR_RESET: u32 = 1;

/// The CRC registers.
#[derive(Debug)]
pub struct Crc {
    dr: u32,
    idr: u8,
}

impl Default for Crc {
    fn default() -> Self {
        Self {
            dr: u32::MAX,
            idr: 0,
        }
    }
}

impl Peripheral for Crc {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        match offset {
            0x00 => Ok(self.dr),
            0x04 => Ok(self.idr.into()),
            0x08 => Ok(0),
            _ => Err(Unmodelled("a reserved address of CRC")),
        }
    }

    fn write(&mut self, offset: u32, value: u32, _now: Time) -> Result<(), Unmodelled> {
        match offset {
            0x00 => {
                self.dr = (0..32).fold(self.dr ^ value, |crc, _| {
                    crc << 1 ^ if crc >> 31 == 0 { 0 } else { POLYNOMIAL }
                });
            }
            0x04 => self.idr = value as u8,
            0x08 if value & CR_RESET != 0 => self.dr = u32::MAX,
            0x08 => {}
            _ => return Err(Unmodelled("a reserved address of CRC")),
        }
        Ok(())
    }

    fn reset(&mut self, _now: Time) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_summed_up_from_a_reset_on() {
        let mut crc = Crc::default();
        for _ in 0..2 {
            // CRC-32/MPEG-2 of the characters 12345678.
            for word in [0x3132_3334, 0x3536_3738] {
                crc.write(0, word, Time::ZERO).unwrap();
            }
            assert_eq!(crc.read(0, Time::ZERO), Ok(0x49E3_C2FB));
            crc.write(8, CR_RESET, Time::ZERO).unwrap();
            assert_eq!(crc.read(0, Time::ZERO), Ok(u32::MAX));
        }
    }
}
