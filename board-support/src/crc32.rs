//! The CRC-32 of what is kept: by flash over an update, by RAM over a reset.

/// Returns the CRC-32 that the part's CRC unit computes (RM0008 4): polynomial 04C11DB7, start FFFFFFFF, not
/// reflected. By bits, for the few words of a record. The CRC of an image is computed by the unit itself.
#[inline(never)]
pub(crate) fn crc32(words: &[u32]) -> u32 {
    words.iter().fold(u32::MAX, |crc, word| {
        (0..32).fold(crc ^ word, |crc, _| {
            let out = if crc >> 31 == 0 { 0 } else { 0x04C1_1DB7 };
            crc << 1 ^ out
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crc_is_that_of_the_parts_unit() {
        // CRC-32/MPEG-2 of the characters 12345678.
        assert_eq!(crc32(&[0x3132_3334, 0x3536_3738]), 0x49E3_C2FB);
    }
}
