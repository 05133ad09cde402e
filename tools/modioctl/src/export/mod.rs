//! Configurations of other systems for a unit with its present settings.

mod csv;
mod home_assistant;
mod json;
mod node_red;
mod telegraf;

use modio_description::{Table, Unit, Value};

use crate::bus::{Endpoint, Place};
use crate::cli::ExportFormat;
use crate::failure::Failure;
use crate::names::{Book, Item, Meaning};

/// Data of an export.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// The names of the unit.
    pub book: &'a Book,
    /// Connection to the unit.
    pub endpoint: &'a Endpoint,
    /// Source of the unit's description.
    pub source: &'a str,
}

/// Returns the text of a configuration.
///
/// # Errors
///
/// When the unit is not a modio, or when the system cannot use the endpoint.
pub fn text(format: ExportFormat, source: Source<'_>) -> Result<String, Failure> {
    match format {
        ExportFormat::Csv => csv::text(source),
        ExportFormat::Json => json::text(source),
        ExportFormat::HomeAssistant => home_assistant::text(source),
        ExportFormat::Telegraf => telegraf::text(source),
        ExportFormat::NodeRed => node_red::text(source),
    }
}

impl Source<'_> {
    /// Returns a name for the unit: board and address.
    fn unit_name(&self) -> Result<String, Failure> {
        let about = self.book.of_modio()?;
        Ok(format!("{} {}", about.board, self.endpoint.unit))
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
                Some((_, name)) => name == "module_state",
            })
    }
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
        match &item.meaning {
            Meaning::Analog(reading) => Self {
                unit: reading.unit.clone(),
                signed: reading.min < 0,
                range: Some((reading.min, reading.max)),
            },
            Meaning::Value(Value::Number(unit) | Value::Long(unit)) => Self {
                unit: unit.clone(),
                signed: false,
                range: None,
            },
            _ => Self {
                unit: Unit::default(),
                signed: false,
                range: None,
            },
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

/// Returns a name with only letters, digits and underscores, in lower case.
fn identifier(name: &str) -> String {
    let character = |c: char| {
        if c.is_ascii_alphanumeric() {
            c.to_ascii_lowercase()
        } else {
            '_'
        }
    };
    name.chars().map(character).collect()
}

/// Returns host and port of a network address.
///
/// # Errors
///
/// When the address has no port.
fn host_and_port(address: &str) -> Result<(String, u16), Failure> {
    let parts = address.rsplit_once(':');
    let parsed = parts.and_then(|(host, port)| Some((host, port.parse().ok()?)));
    let (host, port) = parsed.ok_or_else(|| {
        Failure::usage(format!(
            "{address:?} is not an address with a port; give one such as 192.168.1.5:502"
        ))
    })?;
    let host = host.trim_start_matches('[').trim_end_matches(']');
    Ok((host.to_owned(), port))
}

/// Returns an error for ASCII frames over TCP, which a system cannot use.
fn no_ascii_over_tcp(system: &str, endpoint: &Endpoint) -> Result<(), Failure> {
    let ascii = endpoint.framing == crate::bus::adu::Framing::Ascii;
    if ascii && matches!(endpoint.place, Place::Tcp(_)) {
        return Err(Failure::usage(format!(
            "{system} has no Modbus ASCII over TCP: use --port with a serial port, or leave out --mode ascii"
        )));
    }
    Ok(())
}
