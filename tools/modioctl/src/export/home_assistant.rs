//! YAML for the integrations `modbus` and `template` of Home Assistant.
//!
//! The integration `modbus` has no numbers that a user can set. An analog output is therefore exported as a sensor,
//! together with a number of the integration `template` that shows the sensor and writes with the action
//! `modbus.write_register`.

use modio_description::Table;
use serde_yaml_ng::Mapping;

use super::yaml::{self, map};
use super::{Line, Scaling, Source, identifier, no_ascii_over_tcp, plain, power};
use crate::bus::endpoint::host_and_port;
use crate::bus::{Endpoint, Place};
use crate::failure::Failure;
use crate::names::{Item, Meaning};
use crate::value::unit_name;

/// Interval between two readings of a diagnostic value, in seconds.
const SLOWLY: u16 = 60;

/// Sensors, binary sensors, switches, and numbers of the integration `template`.
type Entities = [Vec<Mapping>; 4];

/// Returns the YAML text. All units of the line are entities of one hub: Home Assistant ignores every further hub with
/// the same serial port, or with the same host and port.
pub fn text(line: Line<'_>) -> Result<String, Failure> {
    no_ascii_over_tcp("Home Assistant", line.endpoint)?;
    let title = line.title()?;
    let name = identifier(&title);
    let mut all = Entities::default();
    for source in line.units {
        let unit = Unit {
            name: &line.unit_name(source)?,
            address: source.unit,
        };
        for (all, of_unit) in all.iter_mut().zip(entities(&name, source, unit)) {
            all.extend(of_unit);
        }
    }
    let [sensors, binary_sensors, switches, numbers] = all;
    // Home Assistant leaves 30 ms on a serial port, and nothing elsewhere.
    let wait = line
        .silence()
        .filter(|silence| *silence > 30 || !line.endpoint.place.is_serial());
    let mut hub = map! { "name": name };
    hub.extend(connection(line.endpoint)?);
    hub.extend(map! {
        "message_wait_milliseconds": wait,
        "sensors": sensors,
        "binary_sensors": binary_sensors,
        "switches": switches,
    });
    let template = (!numbers.is_empty()).then(|| [map! { "number": numbers }]);
    let yaml = yaml::text(&map! { "modbus": [hub], "template": template })?;
    Ok(format!(
        "# Home Assistant configuration for {title}, written by `modioctl export home-assistant`.\n{yaml}"
    ))
}

#[derive(Clone, Copy)]
struct Unit<'a> {
    name: &'a str,
    address: u8,
}

/// Returns the entities of a unit.
fn entities(hub: &str, source: &Source, unit: Unit<'_>) -> Entities {
    let points = || source.book.points();
    let words = || points().filter(|item| item.table == Table::Word);
    let mut sensors: Vec<_> = words().map(|item| sensor(item, unit)).collect();
    let with = |item: &Item, more: Mapping| {
        let mut sensor = sensor(item, unit);
        sensor.extend(more);
        sensor
    };
    let counters = source.counters();
    sensors.extend(counters.map(|item| with(item, map! { "state_class": "total_increasing" })));
    let diagnostics = source.diagnostics();
    sensors.extend(diagnostics.map(|item| with(item, map! { "scan_interval": SLOWLY })));
    let bit = |item: &Item| {
        let mut bit = entity(item, unit);
        bit.extend(match (source.can_set(item), item.writable) {
            (true, _) => map! {
                "write_type": "coil",
                "command_on": 1,
                "command_off": 0,
                "verify": map! { "input_type": "coil" },
            },
            (false, true) => map! { "input_type": "coil" },
            (false, false) => map! { "input_type": "discrete_input" },
        });
        bit
    };
    let bits = points().filter(|item| item.table == Table::Bit);
    let (switches, inputs): (Vec<_>, Vec<_>) = bits.partition(|item| source.can_set(item));
    [
        sensors,
        inputs.into_iter().map(bit).collect(),
        switches.into_iter().map(bit).collect(),
        words()
            .filter(|item| item.writable)
            .map(|item| number(item, unit, hub))
            .collect(),
    ]
}

fn connection(endpoint: &Endpoint) -> Result<Mapping, Failure> {
    let network = |r#type, address: &str| {
        let (host, port) = host_and_port(address).map_err(Failure::usage)?;
        Ok(map! { "type": r#type, "host": host, "port": port })
    };
    match &endpoint.place {
        Place::Serial(port) => Ok(map! {
            "type": "serial",
            "port": port,
            "baudrate": endpoint.baud,
            "bytesize": endpoint.format.data_bits,
            "method": endpoint.framing,
            "parity": endpoint.format.parity.letter(),
            "stopbits": endpoint.format.stop_bits,
        }),
        Place::Tcp(address) => network("rtuovertcp", address),
        Place::ModbusTcp(address) => network("tcp", address),
    }
}

fn name(item: &Item, unit: Unit<'_>) -> String {
    format!("{} {}", unit.name, plain(&item.name))
}

fn entity(item: &Item, unit: Unit<'_>) -> Mapping {
    let name = name(item, unit);
    map! {
        "name": name,
        "unique_id": identifier(&name),
        "slave": unit.address,
        "address": item.address,
    }
}

fn sensor(item: &Item, unit: Unit<'_>) -> Mapping {
    let scaling = Scaling::of(item);
    let shown = shown(&scaling);
    let offset = f64::from(scaling.unit.offset) * shown.factor;
    let mut sensor = entity(item, unit);
    sensor.extend(map! {
        "input_type": if item.writable { "holding" } else { "input" },
        "data_type": scaling.data_type(item).to_lowercase(),
        "scale": (shown.exponent != 0).then_some(shown.factor),
        "offset": (scaling.unit.offset != 0).then_some(offset),
        "precision": (shown.exponent < 0).then(|| shown.exponent.unsigned_abs()),
        "unit_of_measurement": shown.unit,
        "device_class": shown.device_class,
        "state_class": matches!(item.meaning, Meaning::Analog(_)).then_some("measurement"),
    });
    sensor
}

fn number(item: &Item, unit: Unit<'_>, hub: &str) -> Mapping {
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
    let name = name(item, unit);
    let id = identifier(&name);
    let sensor = format!("sensor.{id}");
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
    let write = map! {
        "hub": hub,
        "slave": unit.address,
        "address": item.address,
        "value": format!("{{{{ {value} }}}}"),
    };
    map! {
        "name": format!("{name} set"),
        "unique_id": format!("{id}_set"),
        "state": format!("{{{{ states('{sensor}') }}}}"),
        "availability": format!("{{{{ has_value('{sensor}') }}}}"),
        "min": quantity(min),
        "max": quantity(max),
        "step": shown.factor,
        "unit_of_measurement": shown.unit,
        "set_value": [map! { "action": "modbus.write_register", "data": write }],
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
