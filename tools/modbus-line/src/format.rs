//! Rate and character format of a serial line, and the silences of Modbus that follow from them.

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;
use std::time::Duration;

/// Rates in bit/s that the tests and the simulator support. clap takes a range of this type.
pub const RATES: RangeInclusive<i64> = 300..=4_000_000;

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

impl Parity {
    /// Returns the usual letter: `N`, `E` or `O`.
    #[must_use]
    pub const fn letter(self) -> char {
        match self {
            Self::None => 'N',
            Self::Even => 'E',
            Self::Odd => 'O',
        }
    }
}

/// Format of a character, such as `8N2`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Format {
    /// Data bits, 7 (ASCII only) or 8.
    pub data_bits: u8,
    /// The parity bit.
    pub parity: Parity,
    /// Stop bits, 1 or 2.
    pub stop_bits: u8,
}

impl Format {
    /// Returns the bits of a character on the line, including start, parity and stop bits.
    #[must_use]
    pub const fn bits(self) -> u8 {
        1 + self.data_bits + !matches!(self.parity, Parity::None) as u8 + self.stop_bits
    }
}

/// Rate and character format of one end of a serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineFormat {
    /// Bits per second.
    pub baud: u32,
    /// The character format.
    pub format: Format,
}

impl LineFormat {
    /// Combines a rate and a format.
    #[must_use]
    pub const fn new(baud: u32, format: Format) -> Self {
        Self { baud, format }
    }

    /// Returns the duration of `n` bits.
    #[must_use]
    pub fn bits(self, n: u64) -> Duration {
        bits(self.baud, n)
    }

    /// Returns the duration of `n` characters without gaps, including start, parity and stop bits.
    #[must_use]
    pub fn characters(self, n: usize) -> Duration {
        self.bits(u64::from(self.format.bits()) * n as u64)
    }

    /// Returns t1.5, the longest silence inside a frame: 16.5 bits, above 19200 bit/s 750 us (V1.02, 2.5.1.1).
    #[must_use]
    pub fn t15(self) -> Duration {
        t15(self.baud, STANDARD)
    }

    /// Returns t3.5, the silence that ends a frame: 38.5 bits, above 19200 bit/s 1750 us (V1.02, 2.5.1.1).
    #[must_use]
    pub fn t35(self) -> Duration {
        t35(self.baud, STANDARD)
    }

    /// Returns the values of t1.5 that a unit may use.
    #[must_use]
    pub fn t15_limits(self) -> Limits {
        Limits::of(self.t15(), t15(self.baud, self.format.bits()))
    }

    /// Returns the values of t3.5 that a unit may use.
    #[must_use]
    pub fn t35_limits(self) -> Limits {
        Limits::of(self.t35(), t35(self.baud, self.format.bits()))
    }
}

/// Bits of a character in the standard, which counts the silences in characters of this length (V1.02, 2.5.1).
const STANDARD: u8 = 11;

fn bits(baud: u32, n: u64) -> Duration {
    Duration::from_nanos(n * 1_000_000_000 / u64::from(baud))
}

fn t15(baud: u32, character: u8) -> Duration {
    match baud {
        ..=19_200 => bits(baud, 3 * u64::from(character)) / 2,
        _ => Duration::from_micros(750),
    }
}

/// Returns t3.5 in characters of `character` bits: 3.5 of them, above 19200 bit/s 1750 us.
#[must_use]
pub fn t35(baud: u32, character: u8) -> Duration {
    match baud {
        ..=19_200 => bits(baud, 7 * u64::from(character)) / 2,
        _ => Duration::from_micros(1750),
    }
}

/// Shortest and longest value that a unit may use for a silence. The standard counts characters of 11 bits,
/// whatever the format. Up to 19200 bit/s a unit may count characters of the line's format instead: with 8N1
/// and with seven data bits they have 10 bits. The standard demands nothing between the two values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// A shorter silence is too short for every unit.
    pub least: Duration,
    /// A longer silence is long enough for every unit.
    pub most: Duration,
}

impl Limits {
    fn of(standard: Duration, own: Duration) -> Self {
        Self {
            least: standard.min(own),
            most: standard.max(own),
        }
    }
}

impl Default for Format {
    /// 8N2.
    fn default() -> Self {
        Self {
            data_bits: 8,
            parity: Parity::None,
            stop_bits: 2,
        }
    }
}

impl Default for LineFormat {
    /// 9600 8N2.
    fn default() -> Self {
        Self {
            baud: 9600,
            format: Format::default(),
        }
    }
}

impl fmt::Display for LineFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.baud, self.format)
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parity = self.parity.letter();
        write!(f, "{}{parity}{}", self.data_bits, self.stop_bits)
    }
}

impl FromStr for Format {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?} is not a format: use 8N2, 8E1, 8O1, 8N1, 7E1, 7O1 or 7N2");
        let [data @ b'7'..=b'8', letter, stop @ b'1'..=b'2'] = text.as_bytes() else {
            return Err(wrong());
        };
        Ok(Self {
            data_bits: data - b'0',
            parity: match letter.to_ascii_uppercase() {
                b'N' => Parity::None,
                b'E' => Parity::Even,
                b'O' => Parity::Odd,
                _ => return Err(wrong()),
            },
            stop_bits: stop - b'0',
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
            assert!(text.parse::<Format>().is_err(), "{text}");
        }
    }
}
