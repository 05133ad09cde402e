//! ASCII mode, character by character (V1.02 2.5.2).
//!
//! ```text
//!  +---+-----------+------------+---------------+-----------+--------------+
//!  | : | unit, 2   | function,2 | data, 0 - 504 | LRC, 2    | CR delimiter |
//!  +---+-----------+------------+---------------+-----------+--------------+
//! ```
//!
//! Each byte is sent as two hexadecimal digits, the high one first, `0`-`9` and `A`-`F`. The standard does not
//! allow small letters; they damage a frame. The LRC is the two's complement of the sum of the bytes (6.2.1), so
//! the sum over a complete valid frame is zero.

use super::{Faults, Framing};

/// Data bits of a character on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Width {
    /// Seven, as in the standard. Higher bits from the UART, such as a parity bit, are ignored.
    Seven,
    /// Seven, from a UART that is set to eight because it has no words of seven: the highest bit is the first of
    /// two stop bits. A character with 0 in this bit has a framing error.
    SevenAndStop,
    /// Eight. A character above 7F damages its frame.
    Eight,
}

/// The start of every frame, at any place.
pub(super) const START: u8 = b':';
/// The character before the delimiter.
pub(super) const CR: u8 = b'\r';

/// Position of the next character in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// Before the first digit of a byte, or the carriage return.
    Byte,
    /// Before the second digit.
    Second { high: u8 },
    /// After the carriage return.
    Delimiter,
    /// After the delimiter.
    Over,
}

/// Meaning of a character in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// A byte is complete.
    Byte(u8),
    /// No byte yet, or the end of the frame.
    Nothing,
    /// The character is not allowed at this place.
    Wrong,
}

/// Decodes a frame between the colon and the end.
#[derive(Debug)]
pub(super) struct Reader {
    delimiter: u8,
    mask: u8,
    /// Mask of the bit that is a stop bit, or 0.
    stop: u8,
    place: Place,
}

impl Reader {
    pub(super) const fn new(width: Width) -> Self {
        Self {
            delimiter: Framing::LINE_FEED,
            mask: match width {
                Width::Seven | Width::SevenAndStop => 0x7F,
                Width::Eight => 0xFF,
            },
            stop: match width {
                Width::SevenAndStop => 0x80,
                Width::Seven | Width::Eight => 0,
            },
            place: Place::Byte,
        }
    }

    /// Returns the framing, with its end mark.
    pub(super) const fn framing(&self) -> Framing {
        Framing::Ascii {
            delimiter: self.delimiter,
        }
    }

    pub(super) const fn set_delimiter(&mut self, delimiter: u8) {
        self.delimiter = delimiter;
    }

    /// Returns the character without bits that are not data.
    pub(super) const fn masked(&self, character: u8) -> u8 {
        character & self.mask
    }

    /// Returns the faults of a character with this byte: those that the UART found, and a low stop bit in the byte.
    pub(super) fn faults(&self, byte: u8, found: Faults) -> Faults {
        if !byte & self.stop == 0 {
            found
        } else {
            found | Faults::FRAMING
        }
    }

    /// Begins a frame.
    pub(super) const fn begin(&mut self) {
        self.place = Place::Byte;
    }

    /// Returns whether the frame has ended.
    #[inline]
    pub(super) const fn is_over(&self) -> bool {
        matches!(self.place, Place::Over)
    }

    /// Decodes the next character of the frame, masked.
    pub(super) fn take(&mut self, character: u8) -> Part {
        self.take_good(character).unwrap_or_else(|| {
            // CR and delimiter also end a damaged frame.
            self.place = match character {
                CR => Place::Delimiter,
                _ => Place::Byte,
            };
            Part::Wrong
        })
    }

    /// Decodes the next character of the frame, if it is allowed at this place.
    #[inline(always)]
    pub(super) fn take_good(&mut self, character: u8) -> Option<Part> {
        let (place, part) = match (digit(character), self.place) {
            (Some(high), Place::Byte) => (Place::Second { high }, Part::Nothing),
            (Some(low), Place::Second { high }) => (Place::Byte, Part::Byte(high << 4 | low)),
            (None, Place::Byte) if character == CR => (Place::Delimiter, Part::Nothing),
            (None, Place::Delimiter) if character == self.delimiter => (Place::Over, Part::Nothing),
            _ => return None,
        };
        self.place = place;
        Some(part)
    }
}

/// Returns the value of a hexadecimal digit.
#[inline(always)]
const fn digit(character: u8) -> Option<u8> {
    match character {
        b'0'..=b'9' => Some(character - b'0'),
        b'A'..=b'F' => Some(character - b'A' + 10),
        _ => None,
    }
}

/// Returns the hexadecimal digit of the low half of a value.
#[inline(always)]
pub(super) const fn character(value: u8) -> u8 {
    match value & 0xF {
        value @ 0..=9 => b'0' + value,
        value => b'A' - 10 + value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_is_restored_from_its_digits() {
        let mut reader = Reader::new(Width::Seven);
        for byte in 0..=255 {
            assert_eq!(reader.take(character(byte >> 4)), Part::Nothing);
            assert_eq!(reader.take(character(byte)), Part::Byte(byte));
        }
        assert!((0..16).map(character).eq(*b"0123456789ABCDEF"));
    }

    #[test]
    fn only_digits_of_the_standard_are_accepted() {
        for character in 0..=255_u8 {
            let standard = char::from(character)
                .to_digit(16)
                .filter(|_| !character.is_ascii_lowercase());
            assert_eq!(digit(character).map(u32::from), standard);
        }
    }

    #[test]
    fn a_frame_ends_with_both_characters() {
        let mut reader = Reader::new(Width::Eight);
        assert_eq!(reader.take(b'\n'), Part::Wrong);
        assert_eq!(reader.take(b'1'), Part::Nothing);
        assert_eq!(reader.take(b'\r'), Part::Wrong, "half a byte");
        assert_eq!(reader.take(b'\r'), Part::Wrong);
        assert_eq!(reader.take(b'3'), Part::Wrong);
        assert_eq!(reader.take(b'\n'), Part::Wrong);
        assert_eq!(reader.take(b'1'), Part::Nothing);
        assert_eq!(reader.take(b'2'), Part::Byte(0x12));
        assert_eq!(reader.take(b'\r'), Part::Nothing);
        assert!(!reader.is_over());
        assert_eq!(reader.take(b'\n'), Part::Nothing);
        assert!(reader.is_over());
        assert_eq!(reader.take(b'\n'), Part::Wrong);
        assert!(!reader.is_over());
        reader.take(b'\r');
        reader.begin();
        assert_eq!(reader.take(b'\n'), Part::Wrong);
    }
}
