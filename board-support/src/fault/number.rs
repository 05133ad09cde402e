//! A number from 0 to 255 as a word that a reset keeps: the number, its complement, and a mark that distinguishes it
//! from other numbers and from what RAM holds after power-on.

/// Mark of SW01.
pub(super) const DIP: u32 = 0xD1B5_0000;
/// Mark of the number of saves left.
pub(super) const SAVES: u32 = 0x5A7E_0000;

/// Returns a number as a word to keep.
pub(super) const fn to_word(mark: u32, number: u8) -> u32 {
    mark | (!number as u32) << 8 | number as u32
}

/// Returns the number from a kept word, or `None` when the word is not valid.
pub(super) const fn from_word(mark: u32, word: u32) -> Option<u8> {
    if to_word(mark, word as u8) == word {
        Some(word as u8)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_word_returns_its_number_and_any_flipped_bit_is_detected() {
        for (mark, other) in [(DIP, SAVES), (SAVES, DIP)] {
            for number in 0..=255 {
                let word = to_word(mark, number);
                assert_eq!(from_word(mark, word), Some(number));
                assert_eq!(from_word(other, word), None);
                for bit in 0..32 {
                    let flipped = word ^ 1 << bit;
                    assert_eq!(from_word(mark, flipped), None, "{number}, bit {bit}");
                }
            }
            for noise in [0, u32::MAX, 0xA5A5_A5A5] {
                assert_eq!(from_word(mark, noise), None);
            }
        }
    }
}
