//! Data bits, parity and stop bits.

use std::fmt;
use std::str::FromStr;

/// Format of a character, such as `8N2`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format {
    /// 7 or 8.
    pub data_bits: u8,
    /// `N`, `E` or `O`.
    pub parity: char,
    /// 1 or 2.
    pub stop_bits: u8,
}

impl Format {
    /// Returns the bits of a character on the line, including start, parity and stop bits.
    #[must_use]
    pub fn bits(self) -> u32 {
        1 + u32::from(self.data_bits) + u32::from(self.parity != 'N') + u32::from(self.stop_bits)
    }
}

/// The device's factory setting.
impl Default for Format {
    fn default() -> Self {
        Self {
            data_bits: 8,
            parity: 'N',
            stop_bits: 2,
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}{}", self.data_bits, self.parity, self.stop_bits)
    }
}

impl FromStr for Format {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?} is not a format: use 8N2, 8E1, 8O1, 8N1, 7E1, 7O1 or 7N2");
        let characters: Vec<char> = text.to_ascii_uppercase().chars().collect();
        let [data, parity @ ('N' | 'E' | 'O'), stop] = characters[..] else {
            return Err(wrong());
        };
        let digit = |digit: char| digit.to_digit(10).map(|digit| digit as u8);
        match (digit(data), digit(stop)) {
            (Some(data_bits @ 7..=8), Some(stop_bits @ 1..=2)) => Ok(Self {
                data_bits,
                parity,
                stop_bits,
            }),
            _ => Err(wrong()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_parsed_as_they_are_written() {
        for text in ["8N2", "8E1", "7O1", "8N1"] {
            assert_eq!(text.parse::<Format>().unwrap().to_string(), text);
        }
        assert_eq!("8e1".parse::<Format>().unwrap().bits(), 11);
        for wrong in ["", "8N", "9N1", "8X1", "8N3", "8N21"] {
            assert!(wrong.parse::<Format>().is_err(), "{wrong}");
        }
    }
}
