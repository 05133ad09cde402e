//! CRC-16/MODBUS, one byte at a time (V1.02 6.2.2).

/// The effect of each value of four bits. A table for whole bytes would be faster by three instructions a byte, of about
/// seventy, and larger by 480 bytes.
static TABLE: [u16; 16] = {
    let mut table = [0; 16];
    let mut index = 0;
    while index < table.len() {
        let (mut register, mut bits) = (index as u16, 4);
        while bits > 0 {
            let carry = register & 1;
            register = (register >> 1) ^ (carry * 0xA001);
            bits -= 1;
        }
        table[index] = register;
        index += 1;
    }
    table
};

/// Value of the CRC register before the first byte.
pub const START: u16 = 0xFFFF;

/// Value of the CRC register after a complete valid frame, including its CRC, low byte first.
pub(crate) const GOOD: u16 = 0;

/// Returns the CRC register after one more byte.
#[inline(always)]
#[must_use]
pub const fn step(register: u16, byte: u8) -> u16 {
    // An index of four bits is always in range, so the compiler removes the check. 32 bits need no conversions.
    let register = register as u32 ^ byte as u32;
    let register = (register >> 4) ^ TABLE[(register & 0xF) as usize] as u32;
    let register = (register >> 4) ^ TABLE[(register & 0xF) as usize] as u32;
    register as u16
}

#[cfg(test)]
mod tests {
    use crc::{CRC_16_MODBUS, Crc, Table};

    use super::*;

    #[test]
    fn every_step_is_that_of_the_table() {
        let crc = Crc::<u16, Table<1>>::new(&CRC_16_MODBUS);
        let [table] = crc.table();
        for register in [0x0000, 0xFFFF, 0x1234, 0x8001] {
            for byte in 0..=u8::MAX {
                let [low, _] = u16::to_le_bytes(register);
                let expected = (register >> 8) ^ table[usize::from(low ^ byte)];
                assert_eq!(step(register, byte), expected, "{register:04X} {byte:02X}");
            }
        }
    }

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
