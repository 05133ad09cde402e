//! One number that represents a set of registers.

/// A number that changes when any single bit of the registers changes. Comparing it takes fewer instructions and
/// less RAM than comparing every register.
///
/// Always inlined, because its callers run from RAM. It takes one register per call, because a loop over all
/// registers takes four times as long.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Signature(u32);

impl Signature {
    /// Returns the signature of the previous registers and one more.
    #[inline(always)]
    #[must_use]
    pub(crate) const fn with(self, register: u32) -> Self {
        Self(self.0.rotate_left(5) ^ register)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signature(registers: [u32; 15]) -> Signature {
        registers
            .into_iter()
            .fold(Signature::default(), Signature::with)
    }

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
