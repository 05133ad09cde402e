//! How replies go out, and which end mark requests have.

/// The transmission mode (V1.02 2.5), with what of it can change while the unit runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Framing {
    /// RTU (2.5.1).
    Rtu,
    /// ASCII (2.5.2).
    Ascii {
        /// The last character of a frame, after the carriage return: a line feed, until function
        /// 08 sub-function 03 sets another.
        delimiter: u8,
    },
}

impl Framing {
    /// ASCII as every unit starts: frames end with CR LF.
    pub const ASCII: Self = Self::Ascii {
        delimiter: Self::LINE_FEED,
    };

    pub(super) const LINE_FEED: u8 = b'\n';

    /// Whether a frame can be told to end with this character: a 7-bit one that is nothing else in
    /// a frame already.
    pub(crate) const fn can_end_with(character: u8) -> bool {
        character.is_ascii() && !matches!(character, b':' | b'\r' | b'0'..=b'9' | b'A'..=b'F')
    }

    /// With this character at the end of a frame, if that is what ends one.
    pub(crate) const fn ending_with(self, delimiter: u8) -> Self {
        match self {
            Self::Rtu => Self::Rtu,
            Self::Ascii { .. } => Self::Ascii { delimiter },
        }
    }

    /// As at the start.
    pub(crate) const fn restarted(self) -> Self {
        match self {
            Self::Rtu => Self::Rtu,
            Self::Ascii { .. } => Self::ASCII,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_mark_is_nothing_else() {
        assert!(Framing::can_end_with(b'\n') && Framing::can_end_with(b'#'));
        assert!(Framing::can_end_with(b'G') && Framing::can_end_with(0x7F));
        for character in [b':', b'\r', b'0', b'9', b'A', b'F', 0x80, 0xFF] {
            assert!(!Framing::can_end_with(character), "{character:02X}");
        }
    }
}
