//! A number that changes often, as two words: the number and its complement.
//!
//! The number is written first, so a reset between the two words leaves a number with the complement of the number
//! before it. That is accepted when the new number is one more. A number that is set to 0 is also right in between,
//! because a pair that is not accepted counts as 0.

/// Returns the number of two words, or 0 when they do not belong together.
pub(super) const fn number([number, complement]: [u32; 2]) -> u32 {
    if number.wrapping_sub(!complement) <= 1 {
        number
    } else {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn number_written_in_part_is_the_old_or_the_new_one_and_noise_is_zero() {
        for old in [0, 1, 0xFFFF, 0x7FFF_FFFF, u32::MAX] {
            assert_eq!(number([old, !old]), old);
            let next = old.wrapping_add(1);
            assert_eq!(number([next, !old]), next);
            assert_eq!(number([0, !old]), 0);
        }
        assert_eq!(number([0x1234_5678, 0x9ABC_DEF0]), 0, "noise");
        for bit in 1..32 {
            assert_eq!(number([4 ^ 1 << bit, !4]), 0, "bit {bit}");
        }
    }
}
