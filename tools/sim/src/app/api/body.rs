//! The bodies of the requests that change something. Each is a JSON object.

use std::fmt;

use register_map::Module;
use serde::Deserialize;
use serde::de::{Deserializer, Error as _, MapAccess, Visitor};
use serde_json::{Map, Value, json};
use utoipa::ToSchema;

use super::{Reply, Request};
use crate::app::action::Change;
use crate::app::faults::Faults;
use crate::app::state::ModuleName;
use crate::app::terminals::Applied;

/// Length of the longest PDU in bytes (V1.1b3, 4.1).
const LONGEST_PDU: usize = 253;

type Body = Map<String, Value>;

/// The body of `POST /api/dip`.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Dip {
    /// The new position.
    #[schema(maximum = 255)]
    pub value: u8,
}

/// The body of `POST /api/power`.
#[derive(ToSchema)]
#[schema(rename_all = "snake_case")]
pub enum Power {
    /// Switches the power on or off.
    On(bool),
    /// Switches the power off, and on again 100 ms later. Must be true.
    Cycle(bool),
}

/// The body of `POST /api/module`.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Plug {
    /// The module to plug in.
    #[schema(value_type = ModuleName)]
    pub name: Module,
}

/// A JSON object in which no entry stands twice.
struct Unambiguous(Body);

impl<'de> Deserialize<'de> for Unambiguous {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Entries)
    }
}

/// Collects the entries of an [`Unambiguous`] object.
struct Entries;

impl<'de> Visitor<'de> for Entries {
    type Value = Unambiguous;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Unambiguous, A::Error> {
        let mut body = Body::new();
        while let Some((key, value)) = entries.next_entry::<String, Value>()? {
            if body.contains_key(&key) {
                return Err(A::Error::custom(format_args!("`{key}` stands there twice")));
            }
            body.insert(key, value);
        }
        Ok(Unambiguous(body))
    }
}

/// Returns the JSON object in the body of a POST.
fn body(request: &Request) -> Result<Body, Reply> {
    if request.method != "POST" {
        return Err(Reply::error(405, "this path accepts POST only"));
    }
    let body: Result<Unambiguous, _> = serde_json::from_slice(&request.body);
    body.map(|Unambiguous(body)| body)
        .map_err(|error| Reply::error(400, format!("the body must be a JSON object: {error}")))
}

/// Returns the only entry of an object. A second entry is an error, because a request must not be carried out in part.
fn only(body: &Body) -> Result<(&str, &Value), Reply> {
    let mut entries = body.iter();
    match (entries.next(), entries.next()) {
        (Some((key, value)), None) => Ok((key, value)),
        _ => Err(Reply::error(400, "the object must have exactly one entry")),
    }
}

fn boolean(key: &str, value: &Value) -> Result<bool, Reply> {
    value
        .as_bool()
        .ok_or_else(|| Reply::error(400, format!("`{key}` must be true or false")))
}

fn number(key: &str, value: &Value, largest: u16) -> Result<u16, Reply> {
    value
        .as_u64()
        .and_then(|value| u16::try_from(value).ok())
        .filter(|value| *value <= largest)
        .ok_or_else(|| {
            Reply::error(
                400,
                format!("`{key}` must be a whole number from 0 to {largest}"),
            )
        })
}

fn unknown(key: &str, known: &str) -> Reply {
    Reply::error(400, format!("`{key}` is unknown here; use {known}"))
}

/// Returns the change of a channel.
pub fn change(request: &Request) -> Result<Change, Reply> {
    let body = body(request)?;
    let (key, value) = only(&body)?;
    Ok(match key {
        "energised" => Change::Energised(boolean(key, value)?),
        "manual" => Change::Manual(boolean(key, value)?),
        "millivolts" => Change::Millivolts(number(key, value, 3300)?),
        _ => return Err(unknown(key, "`energised`, `manual` or `millivolts`")),
    })
}

/// Returns what is applied to a terminal.
pub fn applied(request: &Request) -> Result<Applied, Reply> {
    let body = body(request)?;
    let (key, value) = only(&body)?;
    Ok(match key {
        "energised" => Applied::Energised(boolean(key, value)?),
        "millivolts" => Applied::Millivolts(number(key, value, 12_000)?),
        "microamperes" => Applied::Microamperes(number(key, value, 25_000)?),
        "permille" => Applied::Permille(number(key, value, 1000)?),
        "high" => Applied::High(boolean(key, value)?),
        "present" => Applied::Present(boolean(key, value)?),
        _ => {
            let known =
                "`energised`, `millivolts`, `microamperes`, `permille`, `high` or `present`";
            return Err(unknown(key, known));
        }
    })
}

/// Returns the new position of the switch.
pub fn dip(request: &Request) -> Result<Dip, Reply> {
    match only(&body(request)?)? {
        // The limit of 255 makes it fit in one byte.
        (key @ "value", value) => Ok(Dip {
            value: number(key, value, 255)?.to_le_bytes()[0],
        }),
        (key, _) => Err(unknown(key, "`value`")),
    }
}

/// Returns the change of the power.
pub fn power(request: &Request) -> Result<Power, Reply> {
    match only(&body(request)?)? {
        (key @ "on", value) => Ok(Power::On(boolean(key, value)?)),
        ("cycle", value) => Ok(Power::Cycle(*value == Value::Bool(true))),
        (key, _) => Err(unknown(key, "`on` or `cycle`")),
    }
}

/// Returns the request to send to the unit.
pub fn pdu(request: &Request) -> Result<Vec<u8>, Reply> {
    match only(&body(request)?)? {
        ("pdu", Value::String(digits)) => bytes(digits)
            .ok_or_else(|| Reply::error(400, "`pdu` must be 1 to 253 bytes in hexadecimal")),
        ("pdu", _) => Err(Reply::error(400, "`pdu` must be a string")),
        (key, _) => Err(unknown(key, "`pdu`")),
    }
}

fn bytes(digits: &str) -> Option<Vec<u8>> {
    let (pairs, rest) = digits.as_bytes().as_chunks::<2>();
    let digit = |digit: u8| char::from(digit).to_digit(16);
    let byte = |[high, low]: &[u8; 2]| u8::try_from(digit(*high)? * 16 + digit(*low)?).ok();
    let bytes: Vec<u8> = pairs.iter().map(byte).collect::<Option<_>>()?;
    ((1..=LONGEST_PDU).contains(&bytes.len()) && rest.is_empty()).then_some(bytes)
}

/// Returns the module to plug in.
pub fn plug(request: &Request) -> Result<Plug, Reply> {
    match only(&body(request)?)? {
        ("name", Value::String(name)) => {
            let name = name
                .parse()
                .map_err(|why| Reply::error(400, format!("`{name}` is {why}")))?;
            Ok(Plug { name })
        }
        ("name", _) => Err(Reply::error(400, "`name` must be a string")),
        (key, _) => Err(unknown(key, "`name`")),
    }
}

/// Returns the faults to cause or to clear.
pub fn faults(request: &Request) -> Result<Faults, Reply> {
    let body = body(request)?;
    // An error of a single entry does not name it.
    for (key, value) in &body {
        let entry = json!({ key: value });
        Faults::deserialize(entry)
            .map_err(|error| Reply::error(400, format!("`{key}` is wrong: {error}")))?;
    }
    let faults = Faults::deserialize(Value::Object(body))
        .map_err(|error| Reply::error(400, error.to_string()))?;
    if faults.is_empty() {
        return Err(Reply::error(400, "the object names no fault"));
    }
    faults.check().map_err(|what| Reply::error(400, what))?;
    Ok(faults)
}
