//! Rate and character format of a serial line, and the silences of Modbus that follow from them.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

/// Parity of a character.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parity {
    /// No parity bit.
    None,
    /// The number of ones, including the parity bit, is even.
    Even,
    /// The number of ones, including the parity bit, is odd.
    Odd,
}

/// Rate and character format of one end of a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineFormat {
    /// Bits per second.
    pub baud: u32,
    /// Data bits, 7 (ASCII only) or 8.
    pub data_bits: u8,
    /// The parity bit.
    pub parity: Parity,
    /// Stop bits, 1 or 2.
    pub stop_bits: u8,
}

/// The character format without the rate, such as `8N2`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CharacterFormat {
    /// Data bits, 7 or 8.
    pub data_bits: u8,
    /// The parity bit.
    pub parity: Parity,
    /// Stop bits, 1 or 2.
    pub stop_bits: u8,
}

impl LineFormat {
    /// Combines a rate and a format.
    #[must_use]
    pub const fn new(baud: u32, format: CharacterFormat) -> Self {
        Self {
            baud,
            data_bits: format.data_bits,
            parity: format.parity,
            stop_bits: format.stop_bits,
        }
    }

    /// The format without the rate.
    #[must_use]
    pub const fn format(self) -> CharacterFormat {
        CharacterFormat {
            data_bits: self.data_bits,
            parity: self.parity,
            stop_bits: self.stop_bits,
        }
    }

    /// The duration of `n` bits.
    #[must_use]
    pub fn bits(self, n: u64) -> Duration {
        Duration::from_nanos(n * 1_000_000_000 / u64::from(self.baud))
    }

    /// The duration of `n` characters without gaps, including start, parity and stop bits.
    #[must_use]
    pub fn characters(self, n: usize) -> Duration {
        let parity = u64::from(self.parity != Parity::None);
        let bits = 1 + u64::from(self.data_bits) + parity + u64::from(self.stop_bits);
        self.bits(bits * n as u64)
    }

    /// t1.5: the longest silence inside a frame. 16.5 bits, above 19200 bit/s 750 us (V1.02, 2.5.1.1).
    #[must_use]
    pub fn t15(self) -> Duration {
        if self.baud > 19_200 {
            Duration::from_micros(750)
        } else {
            self.bits(33) / 2
        }
    }

    /// t3.5: the silence that ends a frame. 38.5 bits, above 19200 bit/s 1750 us (V1.02, 2.5.1.1).
    #[must_use]
    pub fn t35(self) -> Duration {
        if self.baud > 19_200 {
            Duration::from_micros(1750)
        } else {
            self.bits(77) / 2
        }
    }

    /// Values of t1.5 that a unit may use.
    #[must_use]
    pub fn t15_limits(self) -> Limits {
        Limits::new(self.t15(), self.characters(1) * 3 / 2, self.baud)
    }

    /// Values of t3.5 that a unit may use.
    #[must_use]
    pub fn t35_limits(self) -> Limits {
        Limits::new(self.t35(), self.characters(1) * 7 / 2, self.baud)
    }
}

/// Shortest and longest value that a unit may use for a silence. The standard counts characters of 11 bits,
/// whatever the format. Up to 19200 bit/s a unit may count characters of the line's format instead: with 8N1
/// and with seven data bits they have 10 bits. The suite demands nothing of a silence between the two values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// A shorter silence is too short for every unit.
    pub least: Duration,
    /// A longer silence is long enough for every unit.
    pub most: Duration,
}

impl Limits {
    fn new(standard: Duration, own: Duration, baud: u32) -> Self {
        let own = if baud > 19_200 { standard } else { own };
        Self {
            least: standard.min(own),
            most: standard.max(own),
        }
    }
}

impl Default for LineFormat {
    /// 9600 8N2.
    fn default() -> Self {
        Self {
            baud: 9600,
            data_bits: 8,
            parity: Parity::None,
            stop_bits: 2,
        }
    }
}

impl fmt::Display for LineFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.baud, self.format())
    }
}

impl fmt::Display for CharacterFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parity = match self.parity {
            Parity::None => 'N',
            Parity::Even => 'E',
            Parity::Odd => 'O',
        };
        write!(f, "{}{parity}{}", self.data_bits, self.stop_bits)
    }
}

impl FromStr for CharacterFormat {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong =
            || format!("{text:?} is not a format; use one such as 8N2, 8E1, 8O1, 8N1 or 7E1");
        let [data, parity, stop] = text.as_bytes() else {
            return Err(wrong());
        };
        Ok(Self {
            data_bits: match data {
                b'7' => 7,
                b'8' => 8,
                _ => return Err(wrong()),
            },
            parity: match parity.to_ascii_uppercase() {
                b'N' => Parity::None,
                b'E' => Parity::Even,
                b'O' => Parity::Odd,
                _ => return Err(wrong()),
            },
            stop_bits: match stop {
                b'1' => 1,
                b'2' => 2,
                _ => return Err(wrong()),
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn silences_follow_the_rate_and_are_fixed_above_19200() {
        let at = |baud| LineFormat {
            baud,
            ..LineFormat::default()
        };
        assert_eq!(at(9600).t35().as_micros(), 4010);
        assert_eq!(at(9600).t15().as_micros(), 1718);
        assert_eq!(at(19_200).t35().as_micros(), 2005);
        assert_eq!(at(38_400).t35(), Duration::from_micros(1750));
        assert_eq!(at(115_200).t15(), Duration::from_micros(750));
    }

    #[test]
    fn with_8n1_a_unit_may_count_characters_of_10_bits_up_to_19200() {
        let limits = |baud, format: &str| {
            let line = LineFormat::new(baud, format.parse().unwrap());
            [line.t15_limits(), line.t35_limits()]
                .map(|limits| (limits.least.as_micros(), limits.most.as_micros()))
        };
        assert_eq!(limits(9600, "8N1"), [(1562, 1718), (3645, 4010)]);
        assert_eq!(limits(9600, "8E1"), [(1718, 1718), (4010, 4010)]);
        assert_eq!(limits(38_400, "8N1"), [(750, 750), (1750, 1750)]);
    }

    #[test]
    fn format_is_parsed_and_displayed() {
        for (text, bits) in [("8N1", 10), ("8N2", 11), ("8e1", 11), ("7O1", 10)] {
            let line = LineFormat::new(1000, text.parse().unwrap());
            assert_eq!(line.characters(1), Duration::from_millis(bits), "{text}");
            assert_eq!(line.to_string(), format!("1000 {}", text.to_uppercase()));
        }
        for text in ["", "8", "9N1", "8X1", "8N3", "8N22"] {
            assert!(text.parse::<CharacterFormat>().is_err(), "{text}");
        }
    }
}
