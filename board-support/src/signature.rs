//! One number for a set of registers.

/// A number that differs when the registers differ in any one bit. Comparing it takes fewer instructions, and less
/// RAM, than comparing every register.
#[inline]
pub(crate) fn signature<const N: usize>(registers: [u32; N]) -> u32 {
    registers
        .iter()
        .fold(0, |sum: u32, register| sum.rotate_left(5) ^ register)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_inverted_bit_changes_the_signature() {
        let registers: [u32; 15] = core::array::from_fn(|n| n as u32 * 0x0101_0101);
        for n in 0..registers.len() {
            for bit in 0..32 {
                let mut upset = registers;
                upset[n] ^= 1 << bit;
                assert_ne!(signature(upset), signature(registers), "{n}, bit {bit}");
            }
        }
    }
}
