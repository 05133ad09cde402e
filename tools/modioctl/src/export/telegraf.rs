//! An input for Telegraf, in the configuration style "metric" (Telegraf 1.28 and later).

use serde::Serialize;
use std::collections::BTreeMap;

use modio_description::Table;

use super::{Scaling, Source, identifier};
use crate::bus::Place;
use crate::bus::adu::Framing;
use crate::failure::Failure;
use crate::names::Item;

#[derive(Serialize)]
struct File {
    inputs: Inputs,
}

#[derive(Serialize)]
struct Inputs {
    modbus: [Modbus; 1],
}

#[derive(Serialize)]
struct Modbus {
    name: String,
    timeout: String,
    busy_retries: u8,
    controller: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    baud_rate: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    data_bits: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    parity: Option<char>,
    #[serde(skip_serializing_if = "Option::is_none")]
    stop_bits: Option<u8>,
    transmission_mode: &'static str,
    configuration_type: &'static str,
    metric: [Metric; 1],
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
    #[serde(rename = "type", skip_serializing_if = "Option::is_none")]
    data_type: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    scale: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    output: Option<&'static str>,
}

/// Returns the configuration of the input.
pub fn text(source: Source<'_>) -> Result<String, Failure> {
    let name = source.unit_name()?;
    let about = source.book.of_modio()?;
    let endpoint = source.endpoint;
    let serial = endpoint.place.is_serial();
    let ascii = endpoint.framing == Framing::Ascii;
    let (controller, transmission_mode) = match (&endpoint.place, ascii) {
        (Place::Serial(port), ascii) => (serial_port(port), if ascii { "ASCII" } else { "RTU" }),
        (Place::Tcp(address), false) => (format!("tcp://{address}"), "RTUoverTCP"),
        (Place::Tcp(address), true) => (format!("tcp://{address}"), "ASCIIoverTCP"),
        (Place::ModbusTcp(address), _) => (format!("tcp://{address}"), "TCP"),
    };
    let modbus = Modbus {
        name: name.clone(),
        timeout: format!("{}ms", endpoint.timeout.as_millis()),
        busy_retries: endpoint.retries,
        controller,
        baud_rate: serial.then_some(endpoint.baud),
        data_bits: serial.then_some(endpoint.format.data_bits),
        parity: serial.then_some(endpoint.format.parity),
        stop_bits: serial.then_some(endpoint.format.stop_bits),
        transmission_mode,
        configuration_type: "metric",
        metric: [Metric {
            slave_id: endpoint.unit,
            byte_order: "ABCD",
            measurement: "modio",
            fields: source
                .book
                .points()
                .chain(source.diagnostics())
                .map(field)
                .collect(),
            tags: BTreeMap::from([
                ("board", about.board.clone()),
                ("unit", endpoint.unit.to_string()),
            ]),
        }],
    };
    let file = File {
        inputs: Inputs { modbus: [modbus] },
    };
    let toml = toml::to_string(&file).map_err(Failure::usage)?;
    Ok(format!(
        "# Telegraf input for {name}, written by `modioctl export telegraf`.\n\n{toml}"
    ))
}

/// Returns a serial port in Telegraf's form: a URL for a path, the name for a port of Windows.
fn serial_port(port: &str) -> String {
    if port.starts_with('/') {
        format!("file://{port}")
    } else {
        port.to_owned()
    }
}

/// Returns a field. Its name contains the unit of the quantity. Telegraf has no offset, so a register with an
/// offset is exported as a plain number, without a unit.
fn field(item: &Item) -> Field {
    let scaling = Scaling::of(item);
    let name = item.name.replace(['.', ' '], "_");
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
