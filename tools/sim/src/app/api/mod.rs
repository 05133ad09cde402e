//! The HTTP interface, as a function of a request and the board: no socket, no thread.
//!
//! The attribute `utoipa::path` of each function below has its path and its replies; `GET /api/openapi.json` returns
//! them all.
//!
//! Every path also exists as `/api/boards/NAME/...`; without `boards/NAME` it means the first board. The reply to a
//! POST is the new state, or the new faults. The reply to a wrong request is a 4xx status and `{"error": "..."}`.

mod body;
mod description;
mod outside;
mod pdu;

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;
use sim::Error;
use utoipa::ToSchema;

use self::body::{Dip, Power};
use super::action::Action;
use super::faults::Faults;
use super::findings::{self, Findings};
use super::frames::{self, Frames};
use super::scene::Scene;
use super::state::{self, OneBoard, State};

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

/// The body of a refusal.
#[derive(Serialize, ToSchema)]
#[schema(as = Error)]
struct Refusal {
    error: String,
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
            body: json(&Refusal { error: what }),
        }
    }
}

impl From<Error> for Reply {
    fn from(error: Error) -> Self {
        let status = match error {
            Error::Part(f103::Error::Powered)
            | Error::Channel
            | Error::TerminalKind
            | Error::NoRadio => 409,
            Error::Slot(_) | Error::Terminal => 404,
            _ => 400,
        };
        Self::error(status, error.to_string())
    }
}

type Outcome = Result<Value, Reply>;

/// Carries out a request.
pub fn answer(scene: &mut Scene, request: &Request) -> Reply {
    let (path, query) = request
        .target
        .split_once('?')
        .unwrap_or((&request.target, ""));
    let answered = match path.strip_prefix("/api/") {
        Some(rest) => {
            let (board, rest) = of_board(scene, rest).unwrap_or((0, rest));
            of_path(scene, board, request, rest, query)
        }
        None => None,
    };
    match answered {
        Some(Ok(body)) => Reply { status: 200, body },
        Some(Err(refusal)) => refusal,
        None => Reply::error(404, format!("there is no path {path}")),
    }
}

/// Returns the board that the path names, and the path without its name.
fn of_board<'a>(scene: &Scene, path: &'a str) -> Option<(usize, &'a str)> {
    let (name, rest) = path.strip_prefix("boards/")?.split_once('/')?;
    let mut units = scene.units.iter();
    Some((units.position(|unit| unit.name == name)?, rest))
}

/// Carries out a request for board `n`. Returns `None` if there is no such path.
fn of_path(
    scene: &mut Scene,
    n: usize,
    request: &Request,
    path: &str,
    query: &str,
) -> Option<Outcome> {
    Some(match path {
        "boards" => reading(request).map(|()| get_boards(scene)),
        "endpoints" => reading(request).map(|()| get_endpoints(scene)),
        "state" => reading(request).map(|()| get_state(scene, n)),
        "frames" => reading(request).and_then(|()| get_frames(scene, query)),
        "findings" => reading(request).map(|()| get_findings(scene, n)),
        "openapi.json" => reading(request).map(|()| get_openapi()),
        "faults" if request.method == "GET" => Ok(get_faults(scene, n)),
        "faults" => post_faults(scene, n, request),
        "dip" => post_dip(scene, n, request),
        "pdu" => pdu::post(scene, n, request),
        "power" => post_power(scene, n, request),
        _ => return outside::of_path(scene, n, request, path),
    })
}

/// The visible state of the board
#[utoipa::path(get, path = "/api/state", responses((status = 200, description = "The state", body = State)))]
fn get_state(scene: &mut Scene, n: usize) -> Value {
    json(&state::of_board(scene, n))
}

/// The last 1000 frames on the line
#[utoipa::path(
    get,
    path = "/api/frames",
    params(("since" = inline(Option<u64>), Query, description = "Return only frames with a greater number")),
    responses(
        (status = 200, description = "The frames, oldest first", body = inline(Frames)),
        (status = 400, description = "`since` is not a number", body = Refusal),
    )
)]
fn get_frames(scene: &mut Scene, query: &str) -> Outcome {
    Ok(json(&frames::since(scene.bus.line(), since(query)?)))
}

/// The boards on the line. Every other path also exists as `/api/boards/{name}/...`; without `boards/{name}` it means
/// the first board
#[utoipa::path(
    get,
    path = "/api/boards",
    responses((status = 200, description = "The boards. Paths without a name mean the first one", body = [OneBoard]))
)]
fn get_boards(scene: &Scene) -> Value {
    json(&state::boards(scene))
}

/// The endpoints that the simulator has announced
#[utoipa::path(
    get,
    path = "/api/endpoints",
    responses((
        status = 200,
        description = "Name and address of each endpoint",
        body = inline(BTreeMap<String, String>),
        example = json!({"pty": "/dev/pts/3", "tcp": "127.0.0.1:5020", "http": "http://127.0.0.1:8502/"}),
    ))
)]
fn get_endpoints(scene: &Scene) -> Value {
    json(&scene.endpoints.iter().cloned().collect::<BTreeMap<_, _>>())
}

/// The findings of the chip model: actions of the firmware that a real part does not allow
#[utoipa::path(
    get,
    path = "/api/findings",
    responses((status = 200, description = "The findings, oldest first", body = inline(Findings)))
)]
fn get_findings(scene: &Scene, n: usize) -> Value {
    json(&findings::of_board(scene, n))
}

/// This description
#[utoipa::path(
    get,
    path = "/api/openapi.json",
    responses((status = 200, description = "The description", body = Object))
)]
fn get_openapi() -> Value {
    json(&description::description())
}

/// The faults in force on the line and on the board
#[utoipa::path(get, path = "/api/faults", responses((status = 200, description = "The faults in force", body = Faults)))]
fn get_faults(scene: &mut Scene, n: usize) -> Value {
    json(&state::faults(scene, n))
}

/// Cause or clear faults; an entry that is not named keeps its value
#[utoipa::path(
    post,
    path = "/api/faults",
    request_body = Faults,
    responses((status = 200, description = "The faults in force after the request", body = Faults))
)]
fn post_faults(scene: &mut Scene, n: usize, request: &Request) -> Outcome {
    let action = Action::Faults(body::faults(request)?);
    scene.apply(n, &action)?;
    Ok(get_faults(scene, n))
}

/// Move the DIP switch; the firmware reads it at the next power-on
#[utoipa::path(post, path = "/api/dip", request_body = inline(Dip))]
fn post_dip(scene: &mut Scene, n: usize, request: &Request) -> Outcome {
    let Dip { value } = body::dip(request)?;
    apply(scene, n, &Action::Dip(value))
}

/// Switch the power immediately, whatever the core executes
#[utoipa::path(post, path = "/api/power", request_body = inline(Power))]
fn post_power(scene: &mut Scene, n: usize, request: &Request) -> Outcome {
    match body::power(request)? {
        Power::On(true) => apply(scene, n, &Action::PowerOn),
        Power::On(false) => apply(scene, n, &Action::PowerOff),
        Power::Cycle(true) => {
            scene.cycle(n);
            Ok(get_state(scene, n))
        }
        Power::Cycle(false) => Err(Reply::error(400, "`cycle` must be true")),
    }
}

/// Applies an action to board `n`, and returns the new state.
fn apply(scene: &mut Scene, n: usize, action: &Action) -> Outcome {
    scene.apply(n, action)?;
    Ok(get_state(scene, n))
}

/// Returns a reply as JSON.
pub fn json(reply: &impl Serialize) -> Value {
    // Cannot fail: the replies have no maps with other keys than texts.
    serde_json::to_value(reply).unwrap_or_default()
}

fn reading(request: &Request) -> Result<(), Reply> {
    match request.method.as_str() {
        "GET" => Ok(()),
        _ => Err(Reply::error(405, "this path accepts GET only")),
    }
}

/// Returns the K of `since=K`; 0 without a query, because frames are numbered from 1.
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
mod tests;
