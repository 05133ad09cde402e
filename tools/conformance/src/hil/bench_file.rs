//! The bench file: the hardware of a bench, in TOML. Every key may be left out, and an option of the command line
//! takes precedence over its key. docs/hil.md has examples.
//!
//! Points are addresses of the register map, 0x0000 to 0x001F.

use std::fmt;
use std::ops::Range;
use std::path::PathBuf;
use std::str::FromStr;
use std::time::Duration;

use modbus_line::{Format, RATES};
use register_map::{Module, points};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use toml::Spanned;

/// The contents of a bench file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BenchFile {
    /// The serial port.
    pub port: Option<PathBuf>,
    /// The debug probe.
    pub probe: Option<String>,
    /// Address of the unit under test.
    #[serde(default, deserialize_with = "unit")]
    pub unit: Option<u8>,
    /// Rate of the line, in bit/s.
    #[serde(default, deserialize_with = "baud")]
    pub baud: Option<u32>,
    /// Format of the line.
    #[serde(default, deserialize_with = "text")]
    pub format: Option<Format>,
    /// The module that must be in the first slot.
    #[serde(default, deserialize_with = "text")]
    pub module: Option<Module>,
    /// Switches the unit's power, followed by `off` or `on`.
    pub power_cmd: Option<String>,
    /// Resets the board.
    pub reset_cmd: Option<String>,
    #[serde(default)]
    wire: Vec<Spanned<Digital>>,
    #[serde(default)]
    analog: Vec<Spanned<Analog>>,
    /// Outputs wired to inputs: the digital ones, then the analog ones, each in the order of the file.
    #[serde(skip)]
    pub wires: Vec<Wire>,
}

/// A wire from an output to an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wire {
    /// The output.
    pub from: Place,
    /// The input.
    pub to: Place,
    /// The input follows within this time, 1 ms to 60 s.
    pub within: Duration,
    /// What it carries.
    pub carries: Carries,
}

/// What a wire carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Carries {
    /// A digital signal.
    Bit {
        /// The input is off when the output is on.
        inverted: bool,
        /// Pulses to send to the input's counter; 0: none.
        pulses: u16,
    },
    /// An analog signal.
    Word {
        /// Largest difference between output and input, in the unit of both points.
        tolerance: u16,
    },
}

impl Wire {
    /// Returns whether it carries a digital signal.
    pub const fn is_digital(&self) -> bool {
        matches!(self.carries, Carries::Bit { .. })
    }

    /// Returns whether pulses are sent to the counter of its input.
    pub const fn has_pulses(&self) -> bool {
        matches!(self.carries, Carries::Bit { pulses: 1.., .. })
    }
}

/// A table of digital wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Digital {
    from: Place,
    to: Place,
    #[serde(rename = "within_ms", default = "usual", deserialize_with = "within")]
    within: Duration,
    #[serde(default)]
    inverted: bool,
    #[serde(default)]
    pulses: u16,
}

/// A table of analog wires.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Analog {
    from: Place,
    to: Place,
    tolerance: u16,
    #[serde(
        rename = "within_ms",
        default = "filtered",
        deserialize_with = "within"
    )]
    within: Duration,
}

/// A point of a unit on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Place {
    /// The unit's address, 1 to 247 or 255. Where a file leaves it out it is 0, until [`BenchFile::parse`] has set it.
    #[serde(default, deserialize_with = "address")]
    pub unit: u8,
    /// The point, 0 to 31.
    #[serde(deserialize_with = "point")]
    pub point: u16,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "unit {} point {:#06x}", self.unit, self.point)
    }
}

impl fmt::Display for Wire {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}", self.from, self.to)
    }
}

/// Long enough for an input's debounce of 5 ms, and a slow opto-coupler or relay.
const fn usual() -> Duration {
    Duration::from_millis(100)
}

/// Long enough for the low-pass of an analog input up to FILTER 6.
const fn filtered() -> Duration {
    Duration::from_secs(1)
}

fn unit<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u8>, D::Error> {
    match i64::deserialize(from)? {
        unit @ (1..=247 | 255) => Ok(Some(unit as u8)),
        other => Err(D::Error::custom(format!(
            "unit = {other} is not 1 to 247, or 255"
        ))),
    }
}

fn address<'de, D: Deserializer<'de>>(from: D) -> Result<u8, D::Error> {
    unit(from).map(Option::unwrap_or_default)
}

fn point<'de, D: Deserializer<'de>>(from: D) -> Result<u16, D::Error> {
    let number = i64::deserialize(from)?;
    let point = u16::try_from(number).ok();
    point
        .filter(|point| *point < points::COUNT)
        .ok_or_else(|| D::Error::custom(format!("point = {number:#06x} is not 0 to 0x001F")))
}

fn baud<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u32>, D::Error> {
    match i64::deserialize(from)? {
        baud if RATES.contains(&baud) => Ok(Some(baud as u32)),
        other => Err(D::Error::custom(format!(
            "baud = {other} is not 300 to 4000000"
        ))),
    }
}

fn within<'de, D: Deserializer<'de>>(from: D) -> Result<Duration, D::Error> {
    match i64::deserialize(from)? {
        ms @ 1..=60_000 => Ok(Duration::from_millis(ms as u64)),
        other => Err(D::Error::custom(format!(
            "within_ms = {other} is not 1 to 60000"
        ))),
    }
}

/// Parses a value that is written as on the command line.
fn text<'de, D: Deserializer<'de>, T: FromStr<Err: fmt::Display>>(
    from: D,
) -> Result<Option<T>, D::Error> {
    let text = String::deserialize(from)?;
    text.parse().map(Some).map_err(D::Error::custom)
}

/// An error and its place in the file.
type Wrong = (Range<usize>, String);

impl BenchFile {
    /// Reads a bench file; `unit` is the address on the command line, which takes precedence over the file's.
    ///
    /// # Errors
    ///
    /// The first error in the file, in one line: `LINE: what`.
    pub fn parse(content: &str, unit: Option<u8>) -> Result<Self, String> {
        Self::checked(content, unit).map_err(|(span, what)| {
            let before = content.get(..span.start).unwrap_or(content);
            format!("{}: {what}", before.matches('\n').count() + 1)
        })
    }

    fn checked(content: &str, unit: Option<u8>) -> Result<Self, Wrong> {
        let mut file: Self = toml::from_str(content).map_err(|error| {
            let what = error.message().replace('\n', " ");
            (error.span().unwrap_or_default(), what)
        })?;
        let here = unit.or(file.unit).unwrap_or(1);
        let digital = file.wire.iter().map(|wire| {
            let Digital {
                from,
                to,
                within,
                inverted,
                pulses,
            } = *wire.get_ref();
            let carries = Carries::Bit { inverted, pulses };
            (wire.span(), from, to, within, carries)
        });
        let analog = file.analog.iter().map(|wire| {
            let Analog {
                from,
                to,
                tolerance,
                within,
            } = *wire.get_ref();
            (wire.span(), from, to, within, Carries::Word { tolerance })
        });
        for (span, mut from, mut to, within, carries) in digital.chain(analog) {
            for place in [&mut from, &mut to] {
                if place.unit == 0 {
                    place.unit = here;
                }
            }
            let wire = Wire {
                from,
                to,
                within,
                carries,
            };
            check(&file.wires, &wire).map_err(|what| (span, what))?;
            file.wires.push(wire);
        }
        Ok(file)
    }
}

/// Checks a wire beside those before it. An input has one wire, and no point is both an output and an input.
fn check(before: &[Wire], wire: &Wire) -> Result<(), String> {
    let Wire { from, to, .. } = *wire;
    if before.iter().any(|other| other.to == to) {
        return Err(format!("{to} has a wire already"));
    }
    let mut all = before.iter().chain([wire]);
    if all.any(|other| other.from == to || other.to == from) {
        return Err("a point is an output of one wire and an input of another".to_owned());
    }
    Ok(())
}

#[cfg(test)]
mod tests;
