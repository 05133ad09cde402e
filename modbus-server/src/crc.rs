//! CRC-16/MODBUS, one byte at a time (V1.02 6.2.2).

use crc::{CRC_16_MODBUS, Crc, Table};

/// 256 entries, computed at compile time, 512 bytes of flash.
static TABLE: [u16; 256] = Crc::<u16, Table<1>>::new(&CRC_16_MODBUS).table()[0];

/// Value of the CRC register before the first byte.
pub const START: u16 = 0xFFFF;

/// Value of the CRC register after a complete valid frame, including its CRC, low byte first.
pub(crate) const GOOD: u16 = 0;

/// Returns the CRC register after one more byte.
#[inline]
#[must_use]
pub const fn step(register: u16, byte: u8) -> u16 {
    let [low, _] = register.to_le_bytes();
    // A byte cannot exceed the 256 entries, so the compiler removes the bounds check.
    (register >> 8) ^ TABLE[(low ^ byte) as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn over(bytes: &[u8]) -> u16 {
        bytes
            .iter()
            .fold(START, |register, byte| step(register, *byte))
    }

    #[test]
    fn the_crc_matches_the_check_value_of_the_catalogue() {
        assert_eq!(over(b"123456789"), 0x4B37);
    }

    #[test]
    fn the_crc_matches_the_example_of_the_standard() {
        // V1.02 6.2.2: the CRC of 02 07 is 1241, sent as 41 12.
        assert_eq!(over(&[0x02, 0x07]), 0x1241);
        assert_eq!(over(&[0x02, 0x07, 0x41, 0x12]), GOOD);
        assert_ne!(over(&[0x02, 0x07, 0x12, 0x41]), GOOD);
    }
}
