//! The bench file: the hardware of a bench, in TOML. Every key may be left out, and an option of the command line
//! takes precedence over its key.
//!
//! ```toml
//! port = "/dev/serial/by-id/usb-FTDI_FT232R_USB_UART_A50285BI-if00-port0"
//! probe = "0483:3748"                  # for --flash, as `probe-rs list` shows it
//! unit = 1
//! baud = 9600
//! format = "8N2"
//! module = "4do"                       # the run ends if the first slot has another module
//! power_cmd = "uhubctl -l 1-1 -p 2 -a" # followed by off or on
//! reset_cmd = "./press-reset"
//!
//! [[wire]]                             # a digital output to a digital input
//! from = { point = 0x0010 }            # of the unit under test, where no unit is named
//! to = { unit = 2, point = 0x0010 }
//! within_ms = 50                       # 100 when left out
//! inverted = true                      # the input is off when the output is on; false when left out
//! pulses = 100                         # number of pulses that the input must count; 0 when left out
//!
//! [[analog]]                           # an analog output to an analog input
//! from = { unit = 3, point = 0x0012 }
//! to = { unit = 3, point = 0x0010 }
//! tolerance = 40                       # in the unit of both points: raw codes, mV or uA
//! within_ms = 500                      # 1000 when left out: the input's filter
//! ```
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
    wire: Vec<Spanned<Wire>>,
    #[serde(default)]
    analog: Vec<Spanned<Analog>>,
}

/// A wire from a digital output to a digital input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wire {
    /// The output.
    pub from: Place,
    /// The input.
    pub to: Place,
    /// The input follows within this time, 1 ms to 60 s.
    #[serde(rename = "within_ms", default = "usual", deserialize_with = "within")]
    pub within: Duration,
    /// The input is off when the output is on.
    #[serde(default)]
    pub inverted: bool,
    /// Pulses to send to the input's counter; 0: none.
    #[serde(default)]
    pub pulses: u16,
}

/// A wire from an analog output to an analog input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Analog {
    /// The output.
    pub from: Place,
    /// The input.
    pub to: Place,
    /// Largest difference between output and input, in the unit of both points.
    pub tolerance: u16,
    /// The input follows within this time, 1 ms to 60 s.
    #[serde(
        rename = "within_ms",
        default = "filtered",
        deserialize_with = "within"
    )]
    pub within: Duration,
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

impl fmt::Display for Analog {
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
        let wires = file.wire.iter_mut().map(|wire| {
            let span = wire.span();
            let Wire { from, to, .. } = wire.get_mut();
            (span, from, to)
        });
        let analog = file.analog.iter_mut().map(|wire| {
            let span = wire.span();
            let Analog { from, to, .. } = wire.get_mut();
            (span, from, to)
        });
        let mut ends = Vec::new();
        for (span, from, to) in wires.chain(analog) {
            for place in [&mut *from, &mut *to] {
                if place.unit == 0 {
                    place.unit = here;
                }
            }
            check(&mut ends, (*from, *to)).map_err(|what| (span, what))?;
        }
        Ok(file)
    }

    /// Returns the digital outputs wired to digital inputs, in the order of the file.
    pub fn wires(&self) -> Vec<Wire> {
        self.wire.iter().map(|wire| *wire.get_ref()).collect()
    }

    /// Returns the analog outputs wired to analog inputs, in the order of the file.
    pub fn analog(&self) -> Vec<Analog> {
        self.analog.iter().map(|wire| *wire.get_ref()).collect()
    }
}

/// Adds a wire's ends to those of the wires before it. An input has one wire, and no point is both an output and
/// an input.
fn check(ends: &mut Vec<(Place, Place)>, (from, to): (Place, Place)) -> Result<(), String> {
    if ends.iter().any(|(_, other)| *other == to) {
        return Err(format!("{to} has a wire already"));
    }
    ends.push((from, to));
    if ends.iter().any(|(other, _)| *other == to) || ends.iter().any(|(_, other)| *other == from) {
        return Err("a point is an output of one wire and an input of another".to_owned());
    }
    Ok(())
}

#[cfg(test)]
mod tests;
