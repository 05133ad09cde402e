//! Faults that a UART may report for a character.

use core::ops::BitOr;

/// The faults of one character, as a set. The bits are those of the USARTs of the STM32 (RM0008 27.6.1), so a
/// driver for them can pass its status register through.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Faults(u8);

impl Faults {
    /// No fault.
    pub const NONE: Self = Self(0);
    /// The parity bit is wrong.
    pub const PARITY: Self = Self(1);
    /// The stop bit is low.
    pub const FRAMING: Self = Self(1 << 1);
    /// The samples of a bit differed. The receiver ignores it: the UART used the majority of the samples, and the
    /// parity bit and the CRC or LRC show whether that was right.
    pub const NOISE: Self = Self(1 << 2);
    /// A character before this one was lost, because it was not read in time.
    pub const OVERRUN: Self = Self(1 << 3);

    /// Creates a set from bits: 0 parity, 1 framing, 2 noise, 3 overrun. Other bits are ignored.
    #[inline]
    pub const fn from_bits(bits: u8) -> Self {
        Self(bits & 0x0F)
    }

    /// Returns the bits as [`from_bits`](Self::from_bits) takes them.
    #[inline]
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// Returns whether the received character may be wrong, or another character was lost: true for every fault but
    /// [`NOISE`](Self::NOISE).
    #[inline]
    pub(super) const fn spoil(self) -> bool {
        self.0 & !Self::NOISE.0 != 0
    }

    /// Returns whether this set contains all of `other`.
    #[inline]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

impl BitOr for Faults {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_four_bits_are_faults() {
        assert_eq!(Faults::from_bits(0xF0), Faults::NONE);
        assert_eq!(Faults::from_bits(0xFF).bits(), 0x0F);
        let both = Faults::PARITY | Faults::OVERRUN;
        assert_eq!(both, Faults::from_bits(0b1001));
        assert!(both.contains(Faults::OVERRUN) && !both.contains(Faults::NOISE));
    }

    #[test]
    fn every_fault_but_noise_damages_a_character() {
        for bits in 0..16 {
            let expected = !matches!(bits, 0 | 0b0100);
            assert_eq!(Faults::from_bits(bits).spoil(), expected, "{bits:04b}");
        }
    }
}
