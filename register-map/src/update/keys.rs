//! The numbers of the loader's two public keys, in the last bytes of the loader, where the application reads them.
//!
//! | offset | bytes | content |
//! |---|---|---|
//! | 0 | 4 | `MODK` |
//! | 4 | 4 | version of the loader's rules, 1, little-endian |
//! | 8 | 4, 4 | number of the first key, of the second: the first bytes of the SHA-512 of the public key |

/// Bytes of this place.
pub const BYTES: usize = 16;

const MAGIC: [u8; 8] = *b"MODK\x01\0\0\0";

/// Returns the bytes for these numbers.
#[must_use]
pub const fn encode(numbers: [u32; 2]) -> [u8; BYTES] {
    let [m0, m1, m2, m3, m4, m5, m6, m7] = MAGIC;
    let [first, second] = numbers;
    let ([a, b, c, d], [e, f, g, h]) = (first.to_be_bytes(), second.to_be_bytes());
    [m0, m1, m2, m3, m4, m5, m6, m7, a, b, c, d, e, f, g, h]
}

/// Returns the numbers as records of file 2: high and low word of the first, then of the second. A loader with other
/// rules has zeros here.
#[must_use]
pub fn words(bytes: &[u8; BYTES]) -> [u16; 4] {
    let [m0, m1, m2, m3, m4, m5, m6, m7, a, b, c, d, e, f, g, h] = *bytes;
    if [m0, m1, m2, m3, m4, m5, m6, m7] != MAGIC {
        return [0; 4];
    }
    [[a, b], [c, d], [e, f], [g, h]].map(u16::from_be_bytes)
}

/// Returns the numbers at the beginning of these bytes, zeros if there are none.
#[must_use]
pub fn numbers(bytes: &[u8]) -> [u32; 2] {
    let [a, b, c, d] = bytes.first_chunk().map_or([0; 4], words);
    [[a, b], [c, d]].map(|[high, low]| u32::from(high) << 16 | u32::from(low))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_behind_magic_and_version_alone() {
        let right = encode([0x11FA_5AB8, 0xABCD_0123]);
        assert_eq!(&right[..10], b"MODK\x01\0\0\0\x11\xFA");
        assert_eq!(words(&right), [0x11FA, 0x5AB8, 0xABCD, 0x0123]);
        assert_eq!(numbers(&right), [0x11FA_5AB8, 0xABCD_0123]);
        for byte in 0..8 {
            let mut other = right;
            other[byte] ^= 1;
            assert_eq!(words(&other), [0; 4], "byte {byte}");
        }
        assert_eq!(words(&[0xFF; BYTES]), [0; 4]);
    }
}
