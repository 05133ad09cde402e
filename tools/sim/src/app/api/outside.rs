//! Requests that change what is connected to a board: channels and modules of slots, and terminals.

use super::body::{self, Plug};
use super::{Outcome, Refusal, Reply, Request, apply};
use crate::app::action::{Action, Change};
use crate::app::scene::Scene;
use crate::app::terminals::Applied;

/// Carries out a request for a slot or a terminal of board `n`. Returns `None` if there is no such path.
pub fn of_path(scene: &mut Scene, n: usize, request: &Request, path: &str) -> Option<Outcome> {
    match path.strip_prefix("terminals/") {
        Some(name) => Some(post_terminal(scene, n, request, name)),
        None => of_slot(scene, n, request, path),
    }
}

/// Carries out a request for a slot: the one at the port in `path`, or the first one. Returns `None` if there is no
/// such path.
fn of_slot(scene: &mut Scene, n: usize, request: &Request, path: &str) -> Option<Outcome> {
    let (port, rest) = match path.strip_prefix("slots/") {
        Some(path) => {
            let (port, rest) = path.split_once('/')?;
            (Some(port_number(port)?), rest)
        }
        None => (None, path),
    };
    if rest == "module" {
        return Some(match port {
            Some(port) => post_slot_module(scene, n, request, port),
            None => post_module(scene, n, request, None),
        });
    }
    let channel = rest.strip_prefix("channels/")?;
    Some(match (port, channel_number(channel)) {
        (_, None) => Err(Reply::error(404, "channels are numbered 1 to 4")),
        (Some(port), Some(channel)) => post_slot_channel(scene, n, request, port, channel),
        (None, Some(channel)) => post_channel(scene, n, request, (None, channel)),
    })
}

/// Plug another module into the first slot, while the power is off
#[utoipa::path(
    post,
    path = "/api/module",
    request_body = inline(Plug),
    responses((status = 409, description = "The power is on", body = Refusal))
)]
pub fn post_module(scene: &mut Scene, n: usize, request: &Request, port: Option<u8>) -> Outcome {
    let Plug { name: module } = body::plug(request)?;
    apply(scene, n, &Action::Module { port, module })
}

/// Plug another module into this slot, while the power is off
#[utoipa::path(
    post,
    path = "/api/slots/{port}/module",
    params(("port" = inline(u8), Path, description = "Number of the slot's port", minimum = 1, maximum = 8)),
    request_body = inline(Plug),
    responses(
        (status = 404, description = "The board has no such slot", body = Refusal),
        (status = 409, description = "The power is on", body = Refusal),
    )
)]
pub fn post_slot_module(scene: &mut Scene, n: usize, request: &Request, port: u8) -> Outcome {
    post_module(scene, n, request, Some(port))
}

/// Change what is connected to a channel
#[utoipa::path(
    post,
    path = "/api/channels/{channel}",
    params(("channel" = inline(u8), Path, minimum = 1, maximum = 4)),
    request_body = inline(Change),
    responses(
        (status = 404, description = "There is no such channel", body = Refusal),
        (status = 409, description = "The channel is of another kind", body = Refusal),
    )
)]
pub fn post_channel(
    scene: &mut Scene,
    n: usize,
    request: &Request,
    (port, channel): (Option<u8>, usize),
) -> Outcome {
    let change = body::change(request)?;
    let action = Action::Channel {
        port,
        channel,
        change,
    };
    apply(scene, n, &action)
}

/// Change what is connected to a channel
#[utoipa::path(
    post,
    path = "/api/slots/{port}/channels/{channel}",
    params(
        ("port" = inline(u8), Path, description = "Number of the slot's port", minimum = 1, maximum = 8),
        ("channel" = inline(u8), Path, minimum = 1, maximum = 4),
    ),
    request_body = inline(Change),
    responses(
        (status = 404, description = "There is no such channel", body = Refusal),
        (status = 409, description = "The channel is of another kind", body = Refusal),
    )
)]
pub fn post_slot_channel(
    scene: &mut Scene,
    n: usize,
    request: &Request,
    port: u8,
    channel: usize,
) -> Outcome {
    post_channel(scene, n, request, (Some(port), channel))
}

/// Change what is connected to a terminal of a board with fixed inputs and outputs
#[utoipa::path(
    post,
    path = "/api/terminals/{name}",
    params(("name" = inline(String), Path, description = "Name of the terminal, such as X0")),
    request_body = inline(Applied),
    responses(
        (status = 404, description = "The board has no such terminal", body = Refusal),
        (status = 409, description = "The terminal is of another kind", body = Refusal),
    )
)]
pub fn post_terminal(scene: &mut Scene, n: usize, request: &Request, name: &str) -> Outcome {
    let applied = body::applied(request)?;
    let name = name.to_owned();
    apply(scene, n, &Action::Terminal { name, applied })
}

fn channel_number(text: &str) -> Option<usize> {
    ["1", "2", "3", "4"]
        .iter()
        .position(|number| *number == text)
        .map(|position| position + 1)
}

/// Returns the port in a path. Only the usual form of a number names a port, neither `+1` nor `01`.
fn port_number(text: &str) -> Option<u8> {
    let port: u8 = text.parse().ok()?;
    (port.to_string() == text).then_some(port)
}
