//! The HTTP interface, as a function of a request and the board: no socket, no thread.
//!
//! | request | effect |
//! |---|---|
//! | `GET /api/state` | everything that is visible of the board |
//! | `GET /api/frames?since=K` | those of the last frames on the line that have a number above K |
//! | `GET /api/boards` | the boards: name, board, switch, address in force, power, fault LED, modules |
//! | `GET /api/endpoints` | the endpoints of the simulator by name |
//! | `GET /api/findings` | the findings of the chip model |
//! | `GET /api/openapi.json` | the OpenAPI description of this interface |
//! | `POST /api/channels/N` | `{"energised":bool}`, `{"manual":bool}` or `{"millivolts":n}` outside channel N |
//! | `POST /api/dip` | `{"value":n}`: moves the switch |
//! | `POST /api/power` | `{"on":bool}` or `{"cycle":true}` |
//! | `POST /api/module` | `{"name":...}`: plugs a module, with the power off |
//! | `GET /api/faults` | the faults in force |
//! | `POST /api/faults` | causes or clears faults: any of `bit_error_rate`, `drop_rate`, `noise_hz`, `radio_loss`, `i2c_absent`, `hse_failed`, `hsi_percent`, `lsi_khz` |
//! | `POST /api/slots/PORT/...` | `channels/N` or `module` of the slot at PORT; without it, of the first slot |
//!
//! Every path also exists as `/api/boards/NAME/...`; without `boards/NAME` it means the first board. The reply to a
//! POST is the new state, or the new faults. The reply to a wrong request is a 4xx status and `{"error": "..."}`.

use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, Error as _, MapAccess, Visitor};
use serde_json::{Map, Value, json};

use register_map::Module;
use sim::Error;

use super::action::{Action, Change};
use super::bench::Bench;
use super::faults::Faults;
use super::{frames, state};

/// Longest reason of a refusal, in characters.
const LONGEST_REASON: usize = 300;

/// A request as it was received.
#[derive(Clone, Debug)]
pub struct Request {
    /// `GET`, `POST`, ...
    pub method: String,
    /// Path and query.
    pub target: String,
    /// The body; empty if the request has none.
    pub body: Vec<u8>,
}

/// The reply to a request.
#[derive(Clone, Debug, PartialEq)]
pub struct Reply {
    /// The HTTP status.
    pub status: u16,
    /// The body.
    pub body: Value,
}

impl Reply {
    /// Returns a refusal with an HTTP status and its reason. The reason may repeat what a client has sent: it is
    /// shortened to one line of at most [`LONGEST_REASON`] characters.
    pub fn error(status: u16, what: impl Into<String>) -> Self {
        let what: String = what.into();
        let printed = |c| if char::is_control(c) { ' ' } else { c };
        let what: String = what.chars().take(LONGEST_REASON).map(printed).collect();
        Self {
            status,
            body: json!({ "error": what }),
        }
    }
}

impl From<Error> for Reply {
    fn from(error: Error) -> Self {
        let status = match error {
            Error::Part(f103::Error::Powered) | Error::Channel | Error::NoRadio => 409,
            Error::Slot(_) => 404,
            _ => 400,
        };
        Self::error(status, error.to_string())
    }
}

type Outcome = Result<(), Reply>;
type Body = Map<String, Value>;

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

/// Carries out a request.
pub fn answer(bench: &mut Bench, request: &Request) -> Reply {
    let (path, query) = request
        .target
        .split_once('?')
        .unwrap_or((&request.target, ""));
    let answered = match path.strip_prefix("/api/") {
        Some(rest) => {
            let (board, rest) = of_board(bench, rest).unwrap_or((0, rest));
            of_path(bench, board, request, rest, query)
        }
        None => None,
    };
    match answered {
        Some(Ok(body)) => Reply { status: 200, body },
        Some(Err(refusal)) => refusal,
        None => Reply::error(404, format!("there is no path {path}")),
    }
}

/// The board that the path names, and the path without its name.
fn of_board<'a>(bench: &Bench, path: &'a str) -> Option<(usize, &'a str)> {
    let (name, rest) = path.strip_prefix("boards/")?.split_once('/')?;
    let mut units = bench.units.iter();
    Some((units.position(|unit| unit.name == name)?, rest))
}

/// Carries out a request for board `n`. Returns `None` if there is no such path.
fn of_path(
    bench: &mut Bench,
    n: usize,
    request: &Request,
    path: &str,
    query: &str,
) -> Option<Result<Value, Reply>> {
    Some(match path {
        "boards" => reading(request).map(|()| boards(bench)),
        "endpoints" => reading(request).map(|()| endpoints(bench)),
        "state" => reading(request).map(|()| state::json(bench, n)),
        "frames" => reading(request)
            .and_then(|()| since(query))
            .map(|k| frames::json(bench.bus.line(), k)),
        "findings" => reading(request).map(|()| findings(bench, n)),
        "openapi.json" => reading(request).map(|()| openapi()),
        "faults" if request.method == "GET" => Ok(state::faults(bench, n)),
        "faults" => body(request)
            .and_then(|body| set_faults(bench, n, body))
            .map(|()| state::faults(bench, n)),
        "dip" => changing(bench, n, request, |bench, body| set_dip(bench, n, body)),
        "power" => changing(bench, n, request, |bench, body| set_power(bench, n, body)),
        _ => return of_slot(bench, n, request, path),
    })
}

/// The body of `GET /api/boards`.
fn boards(bench: &Bench) -> Value {
    let boards = bench.units.iter().zip(bench.bus.boards());
    let each = boards.map(|(unit, board)| {
        let modules = board.slots().map(|(_, slot)| slot.module().name());
        json!({
            "name": unit.name,
            "board": board.layout().board.name,
            "dip": board.dip(),
            "address": state::address(board),
            "powered": board.powered(),
            "fault": board.leds().fault,
            "modules": modules.collect::<Vec<_>>(),
        })
    });
    each.collect()
}

/// The body of `GET /api/endpoints`.
fn endpoints(bench: &Bench) -> Value {
    let each = bench.endpoints.iter();
    each.map(|(name, address)| ((*name).to_owned(), json!(address)))
        .collect()
}

/// Carries out a request for a slot: the one at the port in `path`, or the first one. Returns `None` if there is no
/// such path.
fn of_slot(
    bench: &mut Bench,
    n: usize,
    request: &Request,
    path: &str,
) -> Option<Result<Value, Reply>> {
    let (port, rest) = match path.strip_prefix("slots/") {
        Some(path) => {
            let (port, rest) = path.split_once('/')?;
            (Some(port_number(port)?), rest)
        }
        None => (None, path),
    };
    if rest == "module" {
        let change = |bench: &mut Bench, body: &Body| set_module(bench, n, port, body);
        return Some(changing(bench, n, request, change));
    }
    let Some(channel) = channel_number(rest.strip_prefix("channels/")?) else {
        return Some(Err(Reply::error(404, "channels are numbered 1 to 4")));
    };
    let change = |bench: &mut Bench, body: &Body| {
        let change = change(body)?;
        let action = Action::Channel {
            port,
            channel,
            change,
        };
        Ok(bench.apply(n, &action)?)
    };
    Some(changing(bench, n, request, change))
}

/// The body of `GET /api/findings`.
fn findings(bench: &Bench, n: usize) -> Value {
    let each = bench.bus.board(n).findings().iter().map(|finding| {
        json!({
            "at_us": finding.at.as_us(),
            "pc": format!("{:#010x}", finding.pc),
            "what": finding.what.to_string(),
            "count": finding.count,
        })
    });
    json!({ "findings": each.collect::<Vec<_>>() })
}

/// The body of `GET /api/openapi.json`.
fn openapi() -> Value {
    const TEXT: &str = include_str!("openapi.json");
    // Cannot fail: a test parses the same text.
    let mut text: Value = serde_json::from_str(TEXT).unwrap_or_default();
    text["components"]["schemas"]["Module"]["enum"] = json!(Module::ALL.map(Module::name));
    text
}

fn reading(request: &Request) -> Outcome {
    match request.method.as_str() {
        "GET" => Ok(()),
        _ => Err(Reply::error(405, "this path accepts GET only")),
    }
}

/// Calls `change` with the body's JSON object, and returns the new state of board `n`.
fn changing(
    bench: &mut Bench,
    n: usize,
    request: &Request,
    change: impl FnOnce(&mut Bench, &Body) -> Outcome,
) -> Result<Value, Reply> {
    change(bench, &body(request)?)?;
    Ok(state::json(bench, n))
}

/// The JSON object in the body of a POST.
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

fn channel_number(text: &str) -> Option<usize> {
    ["1", "2", "3", "4"]
        .iter()
        .position(|number| *number == text)
        .map(|position| position + 1)
}

/// The port in a path. Only the usual form of a number names a port, neither `+1` nor `01`.
fn port_number(text: &str) -> Option<u8> {
    let port: u8 = text.parse().ok()?;
    (port.to_string() == text).then_some(port)
}

fn change(body: &Body) -> Result<Change, Reply> {
    let (key, value) = only(body)?;
    Ok(match key {
        "energised" => Change::Energised(boolean(key, value)?),
        "manual" => Change::Manual(boolean(key, value)?),
        "millivolts" => Change::Millivolts(number(key, value, 3300)?),
        _ => return Err(unknown(key, "`energised`, `manual` or `millivolts`")),
    })
}

fn set_dip(bench: &mut Bench, n: usize, body: &Body) -> Outcome {
    match only(body)? {
        (key @ "value", value) => {
            // The limit of 255 makes it fit in one byte.
            let dip = number(key, value, 255)?.to_le_bytes()[0];
            Ok(bench.apply(n, &Action::Dip(dip))?)
        }
        (key, _) => Err(unknown(key, "`value`")),
    }
}

fn set_power(bench: &mut Bench, n: usize, body: &Body) -> Outcome {
    let action = match only(body)? {
        (key @ "on", value) => match boolean(key, value)? {
            true => Action::PowerOn,
            false => Action::PowerOff,
        },
        ("cycle", Value::Bool(true)) => {
            bench.cycle(n);
            return Ok(());
        }
        ("cycle", _) => return Err(Reply::error(400, "`cycle` must be true")),
        (key, _) => return Err(unknown(key, "`on` or `cycle`")),
    };
    Ok(bench.apply(n, &action)?)
}

fn set_module(bench: &mut Bench, n: usize, port: Option<u8>, body: &Body) -> Outcome {
    match only(body)? {
        ("name", Value::String(name)) => {
            let module: Module = name
                .parse()
                .map_err(|why| Reply::error(400, format!("`{name}` is {why}")))?;
            Ok(bench.apply(n, &Action::Module { port, module })?)
        }
        ("name", _) => Err(Reply::error(400, "`name` must be a string")),
        (key, _) => Err(unknown(key, "`name`")),
    }
}

fn set_faults(bench: &mut Bench, n: usize, body: Body) -> Outcome {
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
    Ok(bench.apply(n, &Action::Faults(faults))?)
}

/// The K of `since=K`; 0 without a query, because frames are numbered from 1.
fn since(query: &str) -> Result<u64, Reply> {
    if query.is_empty() {
        return Ok(0);
    }
    query
        .strip_prefix("since=")
        .filter(|number| number.bytes().all(|digit| digit.is_ascii_digit()))
        .and_then(|number| number.parse().ok())
        .ok_or_else(|| Reply::error(400, "the query must be `since=K`, with K a whole number"))
}

#[cfg(test)]
#[path = "api_tests/mod.rs"]
mod tests;
