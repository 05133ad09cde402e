//! A loop-back fixture: which output is wired to which input, in TOML.
//!
//! ```toml
//! [[wire]]
//! from = { unit = 1, point = 0x0010 }  # output 1 of the unit at address 1
//! to = { unit = 2, point = 0x0010 }    # input 1 of the unit at address 2
//! within_ms = 50                       # 100 when left out
//! inverted = false                     # the input is off when the output is on; false when left out
//! ```
//!
//! A `unit` left out is the one under test. Points are addresses of the register map, 0x0000 to 0x001F.

use std::fmt;
use std::time::Duration;

use register_map::points;
use serde::Deserialize;

/// All wires, at least one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fixture {
    /// In the order of the file.
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
    /// The input is off when the output is on.
    pub inverted: bool,
}

/// A bit point of a unit on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// The unit's address, 1 to 247 or 255.
    pub unit: u8,
    /// The point, 0 to 31.
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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    wire: Vec<WireInFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WireInFile {
    from: PlaceInFile,
    to: PlaceInFile,
    #[serde(default = "usual")]
    within_ms: u64,
    #[serde(default)]
    inverted: bool,
}

/// Long enough for an input's debounce of 5 ms, and a slow opto-coupler or relay.
const fn usual() -> u64 {
    100
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlaceInFile {
    unit: Option<u8>,
    point: u16,
}

impl Fixture {
    /// Reads a fixture; `unit` is the one under test.
    ///
    /// # Errors
    ///
    /// What is wrong with it, in one line.
    pub fn parse(text: &str, unit: u8) -> Result<Self, String> {
        let file: File = toml::from_str(text).map_err(|error| one_line(&error.to_string()))?;
        if file.wire.is_empty() {
            return Err("there is no [[wire]] in it".to_owned());
        }
        let mut wires: Vec<Wire> = Vec::new();
        for (number, wire) in (1..).zip(file.wire) {
            let wrong = |what: String| format!("wire {number}: {what}");
            let wire = wire.known(unit).map_err(wrong)?;
            if wires.iter().any(|other| other.to == wire.to) {
                return Err(wrong(format!("{} has a wire already", wire.to)));
            }
            if wires
                .iter()
                .any(|other| other.from == wire.to || other.to == wire.from)
                || wire.from == wire.to
            {
                let what = "a point is an output of one wire and an input of another";
                return Err(wrong(what.to_owned()));
            }
            wires.push(wire);
        }
        Ok(Self { wires })
    }
}

impl WireInFile {
    fn known(self, unit: u8) -> Result<Wire, String> {
        if !(1..=60_000).contains(&self.within_ms) {
            return Err(format!("within_ms = {} is not 1 to 60000", self.within_ms));
        }
        Ok(Wire {
            from: self.from.known(unit)?,
            to: self.to.known(unit)?,
            within: Duration::from_millis(self.within_ms),
            inverted: self.inverted,
        })
    }
}

impl PlaceInFile {
    fn known(self, unit: u8) -> Result<Place, String> {
        let unit = self.unit.unwrap_or(unit);
        if !matches!(unit, 1..=247 | 255) {
            return Err(format!("unit = {unit} is not 1 to 247, or 255"));
        }
        if self.point >= points::COUNT {
            return Err(format!("point = {:#06x} is above 0x001F", self.point));
        }
        Ok(Place {
            unit,
            point: self.point,
        })
    }
}

/// An error of the parser, its picture of the place left out.
fn one_line(text: &str) -> String {
    let parts: Vec<&str> = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.contains('|'))
        .collect();
    parts.join(": ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fixture_is_read_with_what_it_leaves_out() {
        let text = "[[wire]]\nfrom = { point = 0x10 }\nto = { unit = 2, point = 17 }\n\
                    [[wire]]\nfrom = { point = 0x10 }\nto = { unit = 2, point = 18 }\n\
                    within_ms = 30\ninverted = true\n";
        let fixture = Fixture::parse(text, 9).unwrap();
        let [first, second] = fixture.wires.as_slice() else {
            panic!("{fixture:?}");
        };
        assert_eq!(
            first.to_string(),
            "unit 9 point 0x0010 to unit 2 point 0x0011"
        );
        assert_eq!(first.within, Duration::from_millis(100));
        assert!(!first.inverted && second.inverted);
        assert_eq!(second.within, Duration::from_millis(30));
    }

    #[test]
    fn what_is_wrong_is_told_in_one_line() {
        let wire = |from: &str, to: &str, more: &str| {
            format!("[[wire]]\nfrom = {from}\nto = {to}\n{more}\n")
        };
        let good = wire("{ point = 16 }", "{ unit = 2, point = 16 }", "");
        for (text, part) in [
            (String::new(), "no [[wire]]"),
            ("[[wire".to_owned(), "line 1"),
            ("[[wires]]".to_owned(), "wires"),
            (wire("{ point = 16 }", "{ unit = 2 }", ""), "point"),
            (wire("{ point = 16 }", "{ point = -1 }", ""), "line 3"),
            (
                wire("{ point = 32 }", "{ unit = 2, point = 1 }", ""),
                "wire 1: point = 0x0020",
            ),
            (
                wire("{ unit = 248, point = 1 }", "{ point = 1 }", ""),
                "unit = 248",
            ),
            (
                wire("{ unit = 0, point = 1 }", "{ point = 1 }", ""),
                "unit = 0",
            ),
            (
                wire("{ point = 1 }", "{ point = 2 }", "within_ms = 0"),
                "within_ms = 0",
            ),
            (
                wire("{ point = 1 }", "{ point = 2 }", "within = 5"),
                "within",
            ),
            (wire("{ point = 1 }", "{ point = 1 }", ""), "output of one"),
            (
                format!("{good}{good}"),
                "wire 2: unit 2 point 0x0010 has a wire already",
            ),
            (
                format!(
                    "{good}{}",
                    wire("{ unit = 2, point = 16 }", "{ point = 3 }", "")
                ),
                "wire 2: a point is",
            ),
        ] {
            let told = Fixture::parse(&text, 1).unwrap_err();
            assert!(
                told.contains(part) && !told.contains('\n'),
                "{text}: {told}"
            );
        }
    }
}
