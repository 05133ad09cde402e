//! The raw value of an analog channel.

/// A code of a 12-bit converter, 0 to 4095: what an analog-to-digital converter gives, or a DAC takes.
///
/// A channel's word in [`Channels`](crate::Channels) is one or is in engineering units, as its
/// [`Scale`](crate::Scale) says; [`scale`](crate::scale) has the way from one to the other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Code(u16);

impl Code {
    /// The largest one.
    pub const MAX: Self = Self(4095);

    /// A code; a number above 4095 counts as 4095.
    #[inline]
    #[must_use]
    pub const fn new(code: u16) -> Self {
        if code > Self::MAX.0 {
            Self::MAX
        } else {
            Self(code)
        }
    }

    /// The number, 0 to 4095.
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
    fn number_beyond_the_converter_counts_as_its_last_code() {
        let codes = [0, 1, 4095, 4096, u16::MAX].map(|code| Code::new(code).get());
        assert_eq!(codes, [0, 1, 4095, 4095, 4095]);
    }
}
