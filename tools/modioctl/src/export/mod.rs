//! Configurations of other systems for the units of a line with their present settings.
//!
//! A unit can send any text in its description. An export contains names in the form of [`plain`]; everything else is
//! written by the serialiser of its format, so that no text becomes a part of the configuration's structure.

mod csv;
mod home_assistant;
mod json;
mod node_red;
mod telegraf;
mod yaml;

use std::collections::BTreeSet;

use modio_description::{Table, Unit};

use crate::bus::adu::Framing;
use crate::bus::{Endpoint, Place};
use crate::failure::Failure;
use crate::held::Held;
use crate::names::{Book, Item, Meaning};

/// Name of a line with several units, if the user gives none.
const LINE: &str = "modio";

/// A system for which a configuration can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum ExportFormat {
    /// A table of all points and registers
    Csv,
    /// The description of the unit, with the endpoint
    Json,
    /// YAML for the integrations modbus and template
    HomeAssistant,
    /// TOML for the input plugin modbus
    Telegraf,
    /// A flow with nodes of node-red-contrib-modbus
    NodeRed,
}

/// The units of a line.
#[derive(Clone, Copy)]
pub struct Line<'a> {
    /// Name of the line, if the user gives one. It distinguishes this line from others in the same system.
    pub name: Option<&'a str>,
    /// Connection to the line.
    pub endpoint: &'a Endpoint,
    /// The units.
    pub units: &'a [Source],
}

/// A unit of an export.
#[derive(Clone, Debug)]
pub struct Source {
    /// Address of the unit.
    pub unit: u8,
    /// The names of the unit.
    pub book: Book,
    /// Source of the unit's description.
    pub source: String,
    /// The outputs that links hold. They are sensors, because a write to them has no effect.
    pub held: Held,
}

/// Returns the text of a configuration.
pub fn text(format: ExportFormat, line: Line<'_>) -> Result<String, Failure> {
    line.check_names()?;
    match format {
        ExportFormat::Csv => csv::text(line),
        ExportFormat::Json => json::text(line),
        ExportFormat::HomeAssistant => home_assistant::text(line),
        ExportFormat::Telegraf => telegraf::text(line),
        ExportFormat::NodeRed => node_red::text(line),
    }
}

impl Line<'_> {
    /// Returns the milliseconds that a master must leave after a reply, so that no unit takes the next request for a
    /// part of another unit's reply: the 3.5 characters of the standard (V1.02, 2.5.1.1) and up to 2 ms. Returns
    /// `None` where frames end in another way.
    fn silence(&self) -> Option<u64> {
        if self.endpoint.framing != Framing::Rtu {
            return None;
        }
        let silence = self.endpoint.line().t35();
        Some(silence.as_millis() as u64 + 2)
    }

    /// Fails when two items have the same name in the form of ids: a system drops or mixes up one of them.
    fn check_names(&self) -> Result<(), Failure> {
        let mut names = BTreeSet::new();
        for source in self.units {
            let unit = self.unit_name(source)?;
            for item in source.items() {
                let name = identifier(&format!("{unit} {}", item.name));
                if !names.insert(name.clone()) {
                    return Err(Failure::Refused(format!(
                        "the description of unit {} has two items that would both be {name}: no export; see `modioctl describe`",
                        source.unit
                    )));
                }
            }
        }
        Ok(())
    }

    /// Returns the name of the line: the name that the user gives, or else that of the only unit.
    fn title(&self) -> Result<String, Failure> {
        match (self.name, self.units) {
            (Some(name), _) => Ok(plain(name)),
            (None, [only]) => self.unit_name(only),
            _ => Ok(LINE.to_owned()),
        }
    }

    /// Returns a name for a unit: the name that the user gives to the line, board and address.
    fn unit_name(&self, source: &Source) -> Result<String, Failure> {
        let about = source.book.of_modio()?;
        let name = format!("{} {}", plain(&about.board), source.unit);
        Ok(match self.name {
            Some(line) => format!("{} {name}", plain(line)),
            None => name,
        })
    }
}

impl Source {
    /// Returns whether a master can set a point.
    fn can_set(&self, point: &Item) -> bool {
        point.writable && !self.held.contains_key(&point.name)
    }

    /// Returns what is exported.
    fn items(&self) -> impl Iterator<Item = &Item> {
        let items = self.book.points().chain(self.counters());
        items.chain(self.diagnostics())
    }

    fn counters(&self) -> impl Iterator<Item = &Item> {
        let is_input = |name: &str| {
            let mut points = self.book.points();
            points.any(|point| point.name == name && point.table == Table::Bit && !point.writable)
        };
        let items = self.book.items().iter();
        items.filter(move |item| item.name.strip_suffix(".pulses").is_some_and(is_input))
    }

    /// Returns the registers that show whether the unit, its modules and its analog points work.
    fn diagnostics(&self) -> impl Iterator<Item = &Item> {
        let analog = |name: &str| {
            let mut points = self.book.points();
            points.any(|point| point.name == name && point.table == Table::Word)
        };
        self.book
            .items()
            .iter()
            .filter(move |item| match item.name.rsplit_once('.') {
                None => matches!(item.name.as_str(), "status" | "uptime"),
                Some((point, "channel_status")) => analog(point),
                Some((port, name)) => name == "module_state" && is_port(port),
            })
    }
}

/// Returns whether a name is that of a port, such as `p5`.
fn is_port(name: &str) -> bool {
    let number = name.strip_prefix('p');
    number.is_some_and(|number| number.parse::<u8>().is_ok())
}

/// Conversion of a register's number to a quantity: `(number + offset) * 10^exponent`.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Scaling {
    unit: Unit,
    /// Whether the word is in two's complement.
    signed: bool,
    /// The smallest and the largest number, if both are known.
    range: Option<(i32, i32)>,
}

impl Scaling {
    fn of(item: &Item) -> Self {
        let range = match &item.meaning {
            Meaning::Analog(reading) => Some((reading.min, reading.max)),
            _ => None,
        };
        Self {
            unit: item.unit(),
            signed: range.is_some_and(|(min, _)| min < 0),
            range,
        }
    }

    /// Returns the factor from the number to the quantity.
    fn factor(&self) -> f64 {
        power(self.unit.exponent)
    }

    /// Returns the data type in capitals: INT16, UINT16 or UINT32.
    fn data_type(&self, item: &Item) -> &'static str {
        match (item.words, self.signed) {
            (2, _) => "UINT32",
            (_, true) => "INT16",
            (_, false) => "UINT16",
        }
    }
}

/// Returns a power of ten, exactly equal to its decimal form.
fn power(exponent: i8) -> f64 {
    format!("1e{exponent}").parse().unwrap_or(1.0)
}

/// Returns whether a name may contain a character.
pub const fn is_plain(c: char) -> bool {
    c.is_ascii_alphanumeric() || matches!(c, ' ' | '.' | '_' | '-')
}

/// Returns a name with `_` for every character that may have a meaning in a configuration, such as `{` and `$`.
fn plain(name: &str) -> String {
    let plain = |c| if is_plain(c) { c } else { '_' };
    name.chars().map(plain).collect()
}

/// Returns a name with only letters, digits and single underscores between them, in lower case. Home Assistant forms
/// the ids of its entities in the same way.
fn identifier(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric());
    let words: Vec<_> = words.filter(|word| !word.is_empty()).collect();
    words.join("_").to_ascii_lowercase()
}

/// Returns an error for ASCII frames over TCP, which a system cannot use.
fn no_ascii_over_tcp(system: &str, endpoint: &Endpoint) -> Result<(), Failure> {
    let ascii = endpoint.framing == Framing::Ascii;
    if ascii && matches!(endpoint.place, Place::Tcp(_)) {
        return Err(Failure::usage(format!(
            "{system} has no Modbus ASCII over TCP: use --port with a serial port, or leave out --mode ascii"
        )));
    }
    Ok(())
}
