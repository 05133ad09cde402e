//! The raw value of an analog channel.

use register_map::limits::RAW_MAX;

/// A code of a 12-bit converter, 0 to 4095: the result of an analog-to-digital converter or the input of a DAC.
///
/// A channel's word in [`Channels`](crate::Channels) is a code or a value in engineering units, depending on its
/// [`Scale`](crate::Scale). [`scale`](crate::scale) converts between them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Code(u16);

impl Code {
    /// The largest code.
    pub const MAX: Self = Self(RAW_MAX);

    /// Creates a code. A number above 4095 becomes 4095.
    #[inline]
    #[must_use]
    pub const fn new(code: u16) -> Self {
        if code > Self::MAX.0 {
            Self::MAX
        } else {
            Self(code)
        }
    }

    /// Returns the number, 0 to 4095.
    #[inline]
    #[must_use]
    pub const fn get(self) -> u16 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn number_above_the_largest_code_becomes_the_largest_code() {
        let codes = [0, 1, 4095, 4096, u16::MAX].map(|code| Code::new(code).get());
        assert_eq!(codes, [0, 1, 4095, 4095, 4095]);
    }
}
