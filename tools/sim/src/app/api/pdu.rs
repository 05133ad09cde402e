//! Requests to the unit of a board, as another master on the line sends them.

use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use super::{Outcome, Refusal, Reply, Request, Scene, body, json, state};
use crate::app::frames::hex;
use crate::app::gateway;

/// The body of `POST /api/pdu`, and its reply.
#[derive(Serialize, ToSchema)]
pub struct Pdu {
    /// Function code and data in hexadecimal, without address and CRC; at most 253 bytes.
    #[schema(examples("0300100004"))]
    pdu: String,
}

/// Send a request to the unit, as another master on the line does, and wait for its reply. The request waits for a free
/// line. It is a frame like any other: it keeps the outputs of a unit with COMM_TIMEOUT alive
#[utoipa::path(
    post,
    path = "/api/pdu",
    request_body = inline(Pdu),
    responses(
        (status = 200, description = "The reply, which may be an exception", body = inline(Pdu)),
        (status = 409, description = "The unit has no address: its power is off, or SW01 was no address", body = Refusal),
        (status = 504, description = "The unit does not reply", body = Refusal),
    )
)]
pub fn post(scene: &mut Scene, n: usize, request: &Request) -> Outcome {
    let pdu = body::pdu(request)?;
    let unit = state::address(scene.bus.board(n)).ok_or_else(|| {
        Reply::error(
            409,
            "the unit has no address: its power is off, or SW01 was no address",
        )
    })?;
    let reply = gateway::ask(scene, n, unit, pdu);
    let pdu = reply.ok_or_else(|| Reply::error(504, "the unit does not reply"))?;
    Ok::<Value, Reply>(json(&Pdu { pdu: hex(&pdu) }))
}
