//! Inputs for Telegraf, in the configuration style "metric" (Telegraf 1.28 and later).
//!
//! Telegraf runs all its inputs at the same time, and an input has the line for itself. All units of a line are
//! therefore one input. Telegraf discards all values of a unit in a round when the unit refuses one request (its
//! `modbus.go`, `gatherFields`). A unit refuses to read an input whose module does not answer. Modbus TCP allows
//! several connections, so that there the inputs of the units are a second input of Telegraf.

use std::collections::BTreeMap;

use serde::Serialize;

use modio_description::Table;

use super::{Line, Scaling, Source, identifier, plain};
use crate::bus::Place;
use crate::bus::adu::Framing;
use crate::failure::Failure;
use crate::names::{Item, Meaning};

/// TOML has no value for `None`: the serialiser leaves such an entry out.
#[derive(Serialize)]
struct Modbus {
    name: String,
    timeout: String,
    busy_retries: u8,
    controller: String,
    baud_rate: Option<u32>,
    data_bits: Option<u8>,
    parity: Option<char>,
    stop_bits: Option<u8>,
    transmission_mode: &'static str,
    configuration_type: &'static str,
    metric: Vec<Metric>,
    workarounds: Option<BTreeMap<&'static str, String>>,
}

#[derive(Serialize)]
struct Metric {
    slave_id: u8,
    byte_order: &'static str,
    measurement: &'static str,
    fields: Vec<Field>,
    tags: BTreeMap<&'static str, String>,
}

#[derive(Serialize)]
struct Field {
    register: &'static str,
    address: u16,
    name: String,
    #[serde(rename = "type")]
    data_type: Option<&'static str>,
    scale: Option<f64>,
    output: Option<&'static str>,
}

/// Returns the configuration of the inputs.
pub fn text(line: Line<'_>) -> Result<String, Failure> {
    let name = line.title()?;
    let is_input = |item: &Item| is_point(item) && !item.writable;
    let modbus = match &line.endpoint.place {
        Place::ModbusTcp(_) => vec![
            modbus(line, &name, |item| !is_input(item))?,
            modbus(line, &name, is_input)?,
        ],
        _ => vec![modbus(line, &name, |_| true)?],
    };
    let modbus = modbus.into_iter().filter(|input| !input.metric.is_empty());
    let inputs = BTreeMap::from([("modbus", modbus.collect::<Vec<_>>())]);
    let file = BTreeMap::from([("inputs", inputs)]);
    let toml = toml::to_string(&file).map_err(Failure::usage)?;
    Ok(format!(
        "# Telegraf input for {name}, written by `modioctl export telegraf`.\n\n{toml}"
    ))
}

fn is_point(item: &Item) -> bool {
    matches!(item.meaning, Meaning::Bit | Meaning::Analog(_))
}

/// Returns an input with the items of all units that `is_wanted` selects.
fn modbus(
    line: Line<'_>,
    name: &str,
    is_wanted: impl Fn(&Item) -> bool,
) -> Result<Modbus, Failure> {
    let endpoint = line.endpoint;
    let serial = endpoint.place.is_serial();
    let ascii = endpoint.framing == Framing::Ascii;
    let (controller, transmission_mode) = match (&endpoint.place, ascii) {
        (Place::Serial(port), ascii) => (serial_port(port), if ascii { "ASCII" } else { "RTU" }),
        (Place::Tcp(address), false) => (format!("tcp://{address}"), "RTUoverTCP"),
        (Place::Tcp(address), true) => (format!("tcp://{address}"), "ASCIIoverTCP"),
        (Place::ModbusTcp(address), _) => (format!("tcp://{address}"), "TCP"),
    };
    let metrics = line.units.iter().map(|unit| metric(unit, &is_wanted));
    let mut metrics = metrics.collect::<Result<Vec<_>, _>>()?;
    // Telegraf refuses a metric without fields.
    metrics.retain(|metric| !metric.fields.is_empty());
    Ok(Modbus {
        name: name.to_owned(),
        timeout: format!("{}ms", endpoint.timeout.as_millis()),
        busy_retries: endpoint.retries,
        controller,
        baud_rate: serial.then_some(endpoint.baud),
        data_bits: serial.then_some(endpoint.format.data_bits),
        parity: serial.then_some(endpoint.format.parity.letter()),
        stop_bits: serial.then_some(endpoint.format.stop_bits),
        transmission_mode,
        configuration_type: "metric",
        metric: metrics,
        workarounds: line
            .silence()
            .map(|silence| BTreeMap::from([("pause_between_requests", format!("{silence}ms"))])),
    })
}

fn metric(source: &Source, is_wanted: impl Fn(&Item) -> bool) -> Result<Metric, Failure> {
    let items = source.items();
    Ok(Metric {
        slave_id: source.unit,
        byte_order: "ABCD",
        measurement: "modio",
        fields: items.filter(|item| is_wanted(item)).map(field).collect(),
        tags: BTreeMap::from([
            ("board", plain(&source.book.of_modio()?.board)),
            ("unit", source.unit.to_string()),
        ]),
    })
}

/// Returns a serial port in Telegraf's form: a URL for a path, the name for a port of Windows. Windows finds the ports
/// from COM10 on by the name of their device only.
fn serial_port(port: &str) -> String {
    let number = port
        .get(..3)
        .filter(|front| front.eq_ignore_ascii_case("COM"))
        .and_then(|_| port[3..].parse::<u32>().ok());
    match number {
        Some(10..) => format!(r"\\.\{port}"),
        _ if port.starts_with('/') => format!("file://{port}"),
        _ => port.to_owned(),
    }
}

/// Returns a field. Its name contains the unit of the quantity. Telegraf has no offset, so a register with an
/// offset is exported as a plain number, without a unit.
fn field(item: &Item) -> Field {
    let scaling = Scaling::of(item);
    let name = plain(&item.name).replace(['.', ' '], "_");
    let plain = scaling.unit.offset != 0 || scaling.unit.code.is_empty();
    let name = if plain {
        name
    } else {
        format!("{name}_{}", unit(&scaling.unit.code))
    };
    let (register, data_type) = match (item.table, item.writable) {
        (Table::Bit, false) => ("discrete", None),
        (Table::Bit, true) => ("coil", None),
        (Table::Word, false) => ("input", Some(scaling.data_type(item))),
        (Table::Word, true) => ("holding", Some(scaling.data_type(item))),
    };
    let scaled = scaling.unit.exponent != 0 && scaling.unit.offset == 0;
    Field {
        register,
        address: item.address,
        name,
        data_type,
        scale: (scaled && data_type.is_some()).then(|| scaling.factor()),
        output: data_type.is_none().then_some("BOOL"),
    }
}

fn unit(code: &str) -> String {
    match code {
        "Cel" => "celsius".to_owned(),
        code if code.chars().all(|c| c.is_ascii_alphanumeric()) => code.to_owned(),
        code => identifier(code),
    }
}
