//! The description as printed by `describe --json`, with the endpoint: an object for one unit, a list for several.

use serde_json::{Value as Json, json};

use super::{Line, Source};
use crate::bus::Place;
use crate::failure::Failure;
use crate::listing::as_json;

/// Returns the description and the endpoint of each unit.
pub fn text(line: Line<'_>) -> Result<String, Failure> {
    let units = line.units.iter().map(|source| unit(line, source));
    let units = units.collect::<Result<Vec<_>, _>>()?;
    let text = match &units[..] {
        [only] => serde_json::to_string_pretty(only),
        units => serde_json::to_string_pretty(units),
    };
    Ok(text.map_err(Failure::usage)? + "\n")
}

fn unit(of: Line<'_>, source: &Source) -> Result<Json, Failure> {
    let mut value = as_json(&source.book, &source.source)?;
    let endpoint = of.endpoint;
    let mut line = json!({ "unit": source.unit });
    match &endpoint.place {
        Place::Serial(port) => {
            line["port"] = json!(port);
            line["baud"] = json!(endpoint.baud);
            line["format"] = json!(endpoint.format.to_string());
            line["mode"] = json!(endpoint.framing);
        }
        Place::Tcp(address) => {
            line["tcp"] = json!(address);
            line["mode"] = json!(endpoint.framing);
        }
        Place::ModbusTcp(address) => line["modbus-tcp"] = json!(address),
    }
    value["endpoint"] = line;
    if let Some(name) = of.name {
        value["line"] = json!(name);
    }
    Ok(value)
}
