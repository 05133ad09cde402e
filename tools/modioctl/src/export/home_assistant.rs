//! YAML for the integrations `modbus` and `template` of Home Assistant.
//!
//! The integration `modbus` has no numbers that a user can set. An analog output is therefore exported as a sensor,
//! together with a number of the integration `template` that shows the sensor and writes with the action
//! `modbus.write_register`.

use modio_description::Table;
use serde::Serialize;

use super::{Line, Scaling, Source, identifier, no_ascii_over_tcp, plain, power, yaml};
use crate::bus::adu::Framing;
use crate::bus::endpoint::host_and_port;
use crate::bus::{Endpoint, Place};
use crate::failure::Failure;
use crate::names::{Item, Meaning};
use crate::value::unit_name;

/// Interval between two readings of a diagnostic value, in seconds.
const SLOWLY: u16 = 60;

#[derive(Serialize)]
struct File {
    modbus: [Hub; 1],
    #[serde(skip_serializing_if = "Vec::is_empty")]
    template: Vec<Template>,
}

#[derive(Serialize)]
struct Hub {
    name: String,
    #[serde(flatten)]
    connection: Connection,
    #[serde(skip_serializing_if = "Option::is_none")]
    message_wait_milliseconds: Option<u64>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    sensors: Vec<Sensor>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    binary_sensors: Vec<BinarySensor>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    switches: Vec<Switch>,
}

#[derive(Serialize)]
#[serde(untagged)]
enum Connection {
    Serial {
        r#type: &'static str,
        port: String,
        baudrate: u32,
        bytesize: u8,
        method: Framing,
        parity: char,
        stopbits: u8,
    },
    Network {
        r#type: &'static str,
        host: String,
        port: u16,
    },
}

#[derive(Serialize)]
struct Entity {
    name: String,
    unique_id: String,
    slave: u8,
    address: u16,
}

#[derive(Serialize)]
struct Sensor {
    #[serde(flatten)]
    entity: Entity,
    input_type: &'static str,
    data_type: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    scale: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    offset: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    precision: Option<u8>,
    #[serde(skip_serializing_if = "Option::is_none")]
    unit_of_measurement: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    device_class: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    state_class: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    scan_interval: Option<u16>,
}

#[derive(Serialize)]
struct BinarySensor {
    #[serde(flatten)]
    entity: Entity,
    input_type: &'static str,
}

#[derive(Serialize)]
struct Switch {
    #[serde(flatten)]
    entity: Entity,
    write_type: &'static str,
    command_on: u8,
    command_off: u8,
    verify: Verify,
}

#[derive(Serialize)]
struct Verify {
    input_type: &'static str,
}

#[derive(Serialize)]
struct Template {
    number: Vec<Number>,
}

#[derive(Serialize)]
struct Number {
    name: String,
    unique_id: String,
    state: String,
    availability: String,
    min: f64,
    max: f64,
    step: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    unit_of_measurement: Option<String>,
    set_value: [Action; 1],
}

#[derive(Serialize)]
struct Action {
    action: &'static str,
    data: Write,
}

#[derive(Serialize)]
struct Write {
    hub: String,
    slave: u8,
    address: u16,
    value: String,
}

/// Returns the YAML text. All units of the line are entities of one hub: Home Assistant ignores every further hub with
/// the same serial port, or with the same host and port.
pub fn text(line: Line<'_>) -> Result<String, Failure> {
    no_ascii_over_tcp("Home Assistant", line.endpoint)?;
    let title = line.title()?;
    let mut hub = Hub {
        name: identifier(&title),
        connection: connection(line.endpoint)?,
        // Home Assistant leaves 30 ms on a serial port, and nothing elsewhere.
        message_wait_milliseconds: line
            .silence()
            .filter(|silence| *silence > 30 || !line.endpoint.place.is_serial()),
        sensors: Vec::new(),
        binary_sensors: Vec::new(),
        switches: Vec::new(),
    };
    let mut numbers = Vec::new();
    for source in line.units {
        let unit = Unit {
            name: &line.unit_name(source)?,
            address: source.unit,
        };
        numbers.extend(entities(&mut hub, source, unit));
    }
    let file = File {
        modbus: [hub],
        template: if numbers.is_empty() {
            Vec::new()
        } else {
            vec![Template { number: numbers }]
        },
    };
    let yaml = yaml::text(&file)?;
    Ok(format!(
        "# Home Assistant configuration for {title}, written by `modioctl export home-assistant`.\n{yaml}"
    ))
}

#[derive(Clone, Copy)]
struct Unit<'a> {
    name: &'a str,
    address: u8,
}

/// Adds the entities of a unit to its hub, and returns its numbers.
fn entities(hub: &mut Hub, source: &Source, unit: Unit<'_>) -> Vec<Number> {
    let points = || source.book.points();
    let words = points().filter(|item| item.table == Table::Word);
    hub.sensors.extend(words.map(|item| sensor(item, unit)));
    hub.sensors.extend(source.counters().map(|item| Sensor {
        state_class: Some("total_increasing"),
        ..sensor(item, unit)
    }));
    hub.sensors.extend(source.diagnostics().map(|item| Sensor {
        scan_interval: Some(SLOWLY),
        ..sensor(item, unit)
    }));
    let bits = || points().filter(|item| item.table == Table::Bit);
    let sensors = bits().filter(|item| !source.can_set(item));
    hub.binary_sensors.extend(sensors.map(|item| BinarySensor {
        entity: entity(item, unit),
        input_type: if item.writable {
            "coil"
        } else {
            "discrete_input"
        },
    }));
    let switches = bits().filter(|item| source.can_set(item));
    hub.switches.extend(switches.map(|item| Switch {
        entity: entity(item, unit),
        write_type: "coil",
        command_on: 1,
        command_off: 0,
        verify: Verify { input_type: "coil" },
    }));
    let outputs = points().filter(|item| item.table == Table::Word && item.writable);
    outputs.map(|item| number(item, unit, &hub.name)).collect()
}

fn connection(endpoint: &Endpoint) -> Result<Connection, Failure> {
    let network = |r#type, address: &str| {
        let (host, port) = host_and_port(address).map_err(Failure::usage)?;
        Ok(Connection::Network { r#type, host, port })
    };
    match &endpoint.place {
        Place::Serial(port) => Ok(Connection::Serial {
            r#type: "serial",
            port: port.clone(),
            baudrate: endpoint.baud,
            bytesize: endpoint.format.data_bits,
            method: endpoint.framing,
            parity: endpoint.format.parity.letter(),
            stopbits: endpoint.format.stop_bits,
        }),
        Place::Tcp(address) => network("rtuovertcp", address),
        Place::ModbusTcp(address) => network("tcp", address),
    }
}

fn entity(item: &Item, unit: Unit<'_>) -> Entity {
    let name = format!("{} {}", unit.name, plain(&item.name));
    Entity {
        unique_id: identifier(&name),
        name,
        slave: unit.address,
        address: item.address,
    }
}

fn sensor(item: &Item, unit: Unit<'_>) -> Sensor {
    let scaling = Scaling::of(item);
    let shown = shown(&scaling);
    let offset = f64::from(scaling.unit.offset) * shown.factor;
    Sensor {
        entity: entity(item, unit),
        input_type: if item.writable { "holding" } else { "input" },
        data_type: scaling.data_type(item).to_lowercase(),
        scale: (shown.exponent != 0).then_some(shown.factor),
        offset: (scaling.unit.offset != 0).then_some(offset),
        precision: (shown.exponent < 0).then(|| shown.exponent.unsigned_abs()),
        unit_of_measurement: shown.unit,
        device_class: shown.device_class,
        state_class: matches!(item.meaning, Meaning::Analog(_)).then_some("measurement"),
        scan_interval: None,
    }
}

fn number(item: &Item, unit: Unit<'_>, hub: &str) -> Number {
    let scaling = Scaling::of(item);
    let shown = shown(&scaling);
    let offset = scaling.unit.offset;
    let (min, max) = scaling.range.unwrap_or((0, 0xFFFF));
    let quantity = |steps: i32| {
        let steps = f64::from(steps) + f64::from(offset);
        // Division by a whole power of ten gives the nearest decimal fraction.
        if shown.exponent < 0 {
            steps / power(shown.exponent.saturating_neg())
        } else {
            steps * shown.factor
        }
    };
    let Entity {
        name, unique_id, ..
    } = entity(item, unit);
    let sensor = format!("sensor.{unique_id}");
    let mut value = match shown.factor {
        1.0 => "value | round | int".to_owned(),
        factor => format!("(value / {factor}) | round | int"),
    };
    if offset != 0 {
        value = format!("({value}) - {offset}");
    }
    if scaling.signed {
        // A value below 0 is written in two's complement.
        value = format!("({value}) % 65536");
    }
    let value = format!("{{{{ {value} }}}}");
    Number {
        unique_id: format!("{unique_id}_set"),
        name: format!("{name} set"),
        state: format!("{{{{ states('{sensor}') }}}}"),
        availability: format!("{{{{ has_value('{sensor}') }}}}"),
        min: quantity(min),
        max: quantity(max),
        step: shown.factor,
        unit_of_measurement: shown.unit.clone(),
        set_value: [Action {
            action: "modbus.write_register",
            data: Write {
                hub: hub.to_owned(),
                slave: unit.address,
                address: item.address,
                value,
            },
        }],
    }
}

/// A quantity as Home Assistant shows it.
struct Shown {
    exponent: i8,
    factor: f64,
    unit: Option<String>,
    device_class: Option<&'static str>,
}

fn shown(scaling: &Scaling) -> Shown {
    let mut exponent = scaling.unit.exponent;
    let (unit, device_class) = match scaling.unit.code.as_str() {
        "uA" => {
            // Home Assistant does not support µA as a unit of current.
            exponent = exponent.saturating_sub(3);
            ("mA", Some("current"))
        }
        "mV" => ("mV", Some("voltage")),
        "Cel" => ("°C", Some("temperature")),
        "s" => ("s", Some("duration")),
        code => (unit_name(code), None),
    };
    // Home Assistant evaluates templates in many of its texts.
    let unit = unit.replace(['{', '}'], "_");
    Shown {
        exponent,
        factor: power(exponent),
        unit: (!unit.is_empty()).then_some(unit),
        device_class,
    }
}
