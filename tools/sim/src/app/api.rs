//! The HTTP interface, as a function of a request and the board: no socket, no thread.
//!
//! | request | what |
//! |---|---|
//! | `GET /api/state` | everything that can be seen of the board |
//! | `GET /api/frames?since=K` | the last frames on the line, those numbered above K |
//! | `GET /api/boards` | the boards: name, board, switch |
//! | `GET /api/findings` | what the chip model objects to |
//! | `GET /api/openapi.json` | this interface, described |
//! | `POST /api/channels/N` | `{"energised":bool}`, `{"manual":bool}` or `{"millivolts":n}` outside channel N |
//! | `POST /api/dip` | `{"value":n}`: moves the switch |
//! | `POST /api/power` | `{"on":bool}` or `{"cycle":true}` |
//! | `POST /api/module` | `{"name":...}`: plugs a module, with the power off |
//! | `POST /api/slots/PORT/...` | `channels/N` or `module` of the slot at PORT; without it, of the first slot |
//!
//! What concerns a board also exists as `/api/boards/NAME/...`. A POST is answered with the state after it, anything else with 4xx and `{"error": "..."}`.

use serde_json::{Map, Value, json};

use register_map::Module;
use sim::Error;

use super::bench::Bench;
use super::{frames, state};

/// A request as it came.
#[derive(Clone, Debug)]
pub struct Request {
    /// `GET`, `POST`, ...
    pub method: String,
    /// Path and query.
    pub target: String,
    /// The body, empty when there is none.
    pub body: Vec<u8>,
}

/// The answer to a request.
#[derive(Clone, Debug, PartialEq)]
pub struct Reply {
    /// The HTTP status.
    pub status: u16,
    /// The body.
    pub body: Value,
}

impl Reply {
    /// A refusal.
    pub fn error(status: u16, what: impl Into<String>) -> Self {
        Self {
            status,
            body: json!({ "error": what.into() }),
        }
    }
}

impl From<Error> for Reply {
    fn from(error: Error) -> Self {
        let status = match error {
            Error::Powered | Error::Channel => 409,
            Error::Slot(_) => 404,
            _ => 400,
        };
        Self::error(status, error.to_string())
    }
}

type Outcome = Result<(), Reply>;

/// Does what a request asks for.
pub fn answer(bench: &mut Bench, request: &Request) -> Reply {
    let (path, query) = request
        .target
        .split_once('?')
        .unwrap_or((&request.target, ""));
    let answered = match path.strip_prefix("/api/").map(|path| of_board(bench, path)) {
        Some("boards") => reading(request).map(|()| boards(bench)),
        Some("state") => reading(request).map(|()| state::json(bench)),
        Some("frames") => reading(request)
            .and_then(|()| since(query))
            .map(|k| frames::json(bench.board.line(), k)),
        Some("findings") => reading(request).map(|()| findings(bench)),
        Some("openapi.json") => reading(request).map(|()| openapi()),
        Some("dip") => changing(bench, request, set_dip),
        Some("power") => changing(bench, request, set_power),
        Some(rest) => of_slot(bench, request, rest)
            .unwrap_or_else(|| Err(Reply::error(404, format!("there is no {path}")))),
        None => Err(Reply::error(404, format!("there is no {path}"))),
    };
    match answered {
        Ok(body) => Reply { status: 200, body },
        Err(refusal) => refusal,
    }
}

/// The path without the board's name, if it begins with that.
fn of_board<'a>(bench: &Bench, path: &'a str) -> &'a str {
    path.strip_prefix("boards/")
        .and_then(|path| path.strip_prefix(name(bench)))
        .and_then(|path| path.strip_prefix('/'))
        .unwrap_or(path)
}

/// The only board's name: it is called after what it is.
fn name(bench: &Bench) -> &'static str {
    bench.board.layout().board.name
}

/// The body of `GET /api/boards`.
fn boards(bench: &Bench) -> Value {
    json!([{ "name": name(bench), "board": name(bench), "dip": bench.board.dip() }])
}

/// What concerns a slot, the first one unless `path` names a port; `None` when `path` is none of these.
fn of_slot(bench: &mut Bench, request: &Request, path: &str) -> Option<Result<Value, Reply>> {
    let (port, rest) = match path.strip_prefix("slots/") {
        Some(path) => path.split_once('/')?,
        None => ("", path),
    };
    let port = if port.is_empty() {
        bench.board.layout().slots[0].port
    } else {
        port.parse().ok()?
    };
    if rest == "module" {
        let change = |bench: &mut Bench, body: &Map<_, _>| set_module(bench, port, body);
        return Some(changing(bench, request, change));
    }
    let Some(number) = channel_number(rest.strip_prefix("channels/")?) else {
        return Some(Err(Reply::error(404, "channels are numbered 1 to 4")));
    };
    let change = |bench: &mut Bench, body: &Map<_, _>| set_channel(bench, port, number, body);
    Some(changing(bench, request, change))
}

/// The body of `GET /api/findings`.
fn findings(bench: &Bench) -> Value {
    let each = bench.board.findings().iter().map(|finding| {
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
    // A test reads it.
    serde_json::from_str(TEXT).unwrap_or_default()
}

fn reading(request: &Request) -> Outcome {
    match request.method.as_str() {
        "GET" => Ok(()),
        _ => Err(Reply::error(405, "only GET here")),
    }
}

/// Does `change` with the body's JSON object, and answers with the state after it.
fn changing(
    bench: &mut Bench,
    request: &Request,
    change: impl FnOnce(&mut Bench, &Map<String, Value>) -> Outcome,
) -> Result<Value, Reply> {
    if request.method != "POST" {
        return Err(Reply::error(405, "only POST here"));
    }
    let body: Value = serde_json::from_slice(&request.body)
        .map_err(|error| Reply::error(400, format!("the body is not JSON: {error}")))?;
    let body = body
        .as_object()
        .ok_or_else(|| Reply::error(400, "the body is not a JSON object"))?;
    change(bench, body)?;
    Ok(state::json(bench))
}

/// The only entry of an object that may have no other, as what was asked for may not be half done.
fn only(body: &Map<String, Value>) -> Result<(&str, &Value), Reply> {
    let mut entries = body.iter();
    match (entries.next(), entries.next()) {
        (Some((key, value)), None) => Ok((key, value)),
        _ => Err(Reply::error(400, "one entry is wanted in the object")),
    }
}

fn boolean(key: &str, value: &Value) -> Result<bool, Reply> {
    value
        .as_bool()
        .ok_or_else(|| Reply::error(400, format!("`{key}` is true or false")))
}

fn number(key: &str, value: &Value, largest: u16) -> Result<u16, Reply> {
    value
        .as_u64()
        .and_then(|value| u16::try_from(value).ok())
        .filter(|value| *value <= largest)
        .ok_or_else(|| {
            Reply::error(
                400,
                format!("`{key}` is a whole number from 0 to {largest}"),
            )
        })
}

fn unknown(key: &str, wanted: &str) -> Reply {
    Reply::error(
        400,
        format!("`{key}` means nothing here: {wanted} is wanted"),
    )
}

fn channel_number(text: &str) -> Option<usize> {
    ["1", "2", "3", "4"]
        .iter()
        .position(|number| *number == text)
        .map(|position| position + 1)
}

fn set_channel(bench: &mut Bench, port: u8, channel: usize, body: &Map<String, Value>) -> Outcome {
    let (key, value) = only(body)?;
    let board = &mut bench.board;
    let done = match key {
        "energised" => {
            let on = boolean(key, value)?;
            board.change_slot(port, |slot| slot.set_energised(channel, on))?
        }
        "manual" => {
            let on = boolean(key, value)?;
            board.change_slot(port, |slot| slot.set_manual(channel, on))?
        }
        "millivolts" => {
            let millivolts = number(key, value, 3300)?;
            board.change_slot(port, |slot| slot.set_millivolts(channel, millivolts))?
        }
        _ => return Err(unknown(key, "`energised`, `manual` or `millivolts`")),
    };
    Ok(done.map_err(Error::from)?)
}

fn set_dip(bench: &mut Bench, body: &Map<String, Value>) -> Outcome {
    match only(body)? {
        (key @ "value", value) => {
            // 255 fits in eight switches.
            bench
                .board
                .set_dip(number(key, value, 255)?.to_le_bytes()[0]);
            Ok(())
        }
        (key, _) => Err(unknown(key, "`value`")),
    }
}

fn set_power(bench: &mut Bench, body: &Map<String, Value>) -> Outcome {
    match only(body)? {
        (key @ "on", value) => match boolean(key, value)? {
            true => bench.board.power_on(),
            false => bench.board.power_off(),
        },
        ("cycle", Value::Bool(true)) => bench.board.cycle(),
        ("cycle", _) => return Err(Reply::error(400, "`cycle` is true")),
        (key, _) => return Err(unknown(key, "`on` or `cycle`")),
    }
    Ok(())
}

fn set_module(bench: &mut Bench, port: u8, body: &Map<String, Value>) -> Outcome {
    match only(body)? {
        ("name", Value::String(name)) => {
            let module: Module = name
                .parse()
                .map_err(|why| Reply::error(400, format!("`{name}` is {why}")))?;
            Ok(bench.board.set_module_at(port, module)?)
        }
        ("name", _) => Err(Reply::error(400, "`name` is a string")),
        (key, _) => Err(unknown(key, "`name`")),
    }
}

/// The K of `since=K`; 0, which is before all frames, without a query.
fn since(query: &str) -> Result<u64, Reply> {
    if query.is_empty() {
        return Ok(0);
    }
    query
        .strip_prefix("since=")
        .and_then(|number| number.parse().ok())
        .ok_or_else(|| Reply::error(400, "only `since=K` is understood here, K a whole number"))
}

#[cfg(test)]
#[path = "api_tests.rs"]
mod tests;
