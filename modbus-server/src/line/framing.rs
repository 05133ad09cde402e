//! Framing of replies, and the end mark of requests.

/// The transmission mode (V1.02 2.5), including the part that can change at run time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Framing {
    /// RTU (2.5.1).
    Rtu,
    /// ASCII (2.5.2).
    Ascii {
        /// The last character of a frame, after the carriage return: a line feed, until function 08 sub-function 03
        /// changes it.
        delimiter: u8,
    },
}

impl Framing {
    /// ASCII mode as at the start: frames end with CR LF.
    pub const ASCII: Self = Self::Ascii {
        delimiter: Self::LINE_FEED,
    };

    pub(super) const LINE_FEED: u8 = b'\n';

    /// Returns whether this character can end a frame: a 7-bit character that has no other meaning in a frame.
    pub(crate) const fn can_end_with(character: u8) -> bool {
        character.is_ascii() && !matches!(character, b':' | b'\r' | b'0'..=b'9' | b'A'..=b'F')
    }

    /// Returns the framing with this end mark. RTU framing does not change.
    pub(crate) const fn ending_with(self, delimiter: u8) -> Self {
        match self {
            Self::Rtu => Self::Rtu,
            Self::Ascii { .. } => Self::Ascii { delimiter },
        }
    }

    /// Returns the framing as at the start.
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
    fn an_end_mark_has_no_other_meaning_in_a_frame() {
        assert!(Framing::can_end_with(b'\n') && Framing::can_end_with(b'#'));
        assert!(Framing::can_end_with(b'G') && Framing::can_end_with(0x7F));
        for character in [b':', b'\r', b'0', b'9', b'A', b'F', 0x80, 0xFF] {
            assert!(!Framing::can_end_with(character), "{character:02X}");
        }
    }
}
