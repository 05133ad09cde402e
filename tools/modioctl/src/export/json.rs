//! The description as printed by `describe --json`, with the endpoint.

use serde_json::json;

use super::Source;
use crate::bus::Place;
use crate::failure::Failure;
use crate::listing::as_json;

/// Returns the description and the endpoint.
pub fn text(source: Source<'_>) -> Result<String, Failure> {
    let mut value = as_json(source.book, source.source)?;
    let endpoint = source.endpoint;
    let mut line = json!({ "unit": endpoint.unit });
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
    let text = serde_json::to_string_pretty(&value).map_err(Failure::usage)?;
    Ok(text + "\n")
}
