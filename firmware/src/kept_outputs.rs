//! What every output has, as a reset that is not a power-on keeps it.
//!
//! ```text
//! half-word of an output    | inverted sum of the three digits | raw value, three hexadecimal digits |
//!                            15                              12 11                                 0
//! ```
//!
//! Each output has a half-word, which is stored at once when the output changes. So after a reset at any instant it has
//! the old value or the new one. 0 is never valid.

use register_map::points;

/// Number of points, each with a half-word.
const POINTS: usize = points::COUNT as usize;

/// The outputs at the last reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeptOutputs {
    /// The half-word of each point, by address.
    pub values: [u16; POINTS],
    /// The modules that were in force: 4 bits for each port, port 1 lowest.
    pub modules: u32,
    /// The outputs that a link held, by address, point 0 in bit 0.
    pub held: u32,
    /// The outputs that were at SAFE and were not commanded since, by address, point 0 in bit 0.
    pub at_safe: u32,
}

impl KeptOutputs {
    /// Returns the raw value of the output with this address, 0 to 31; `None` if none is kept.
    #[must_use]
    pub fn value(&self, point: u16) -> Option<u16> {
        value_of(*self.values.get(usize::from(point))?)
    }
}

/// Returns the half-word of a raw value: 0 or 1 for a bit, 0 to 4095 for a word.
#[must_use]
pub const fn half_word_of(value: u16) -> u16 {
    let value = value & 0xFFF;
    let sum = value + (value >> 4) + (value >> 8);
    !sum << 12 | value
}

/// Returns the raw value of a half-word, if it is valid.
const fn value_of(half_word: u16) -> Option<u16> {
    let value = half_word & 0xFFF;
    if half_word_of(value) == half_word {
        Some(value)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_word_of_each_raw_value_is_valid_and_never_zero() {
        for value in 0..=4095 {
            assert_eq!(value_of(half_word_of(value)), Some(value));
            assert_ne!(half_word_of(value), 0);
        }
        assert_eq!(half_word_of(0), 0xF000);
        assert_eq!(half_word_of(1), 0xE001);
        assert_eq!(half_word_of(0xABC), 0xEABC, "10 + 11 + 12 = 0x21");
    }

    #[test]
    fn one_changed_bit_of_a_half_word_is_found() {
        for value in 0..=4095 {
            for bit in 0..16 {
                assert_eq!(value_of(half_word_of(value) ^ 1 << bit), None);
            }
        }
        assert_eq!(value_of(0), None);
        assert_eq!(value_of(0xFFFF), None);
    }
}
