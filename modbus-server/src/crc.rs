//! CRC-16/MODBUS, one byte at a time (V1.02 6.2.2).

use crc::{CRC_16_MODBUS, Crc, Table};

/// 256 entries, built by the compiler, 512 bytes of flash.
static TABLE: [u16; 256] = Crc::<u16, Table<1>>::new(&CRC_16_MODBUS).table()[0];

/// The register before the first byte.
pub const START: u16 = 0xFFFF;

/// The register after a whole good frame: its own CRC, low byte first, always leads here.
pub(crate) const GOOD: u16 = 0;

/// The register after one more byte.
#[inline]
#[must_use]
pub const fn step(register: u16, byte: u8) -> u16 {
    let [low, _] = register.to_le_bytes();
    // A byte cannot index beyond 256 entries: no bounds check is left.
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
    fn the_check_value_of_the_catalogue() {
        assert_eq!(over(b"123456789"), 0x4B37);
    }

    #[test]
    fn the_standard_s_example() {
        // V1.02 6.2.2: the CRC of 02 07 is 1241, sent as 41 12.
        assert_eq!(over(&[0x02, 0x07]), 0x1241);
        assert_eq!(over(&[0x02, 0x07, 0x41, 0x12]), GOOD);
        assert_ne!(over(&[0x02, 0x07, 0x12, 0x41]), GOOD);
    }
}
