//! `--trace`: prints every frame on standard error, with times and in words.

use tokio::time::Instant;

use crate::bus::adu::{self, Framing};
use crate::bus::{Direction, Observer, Seen, decode};

/// Returns an observer that prints.
pub fn to_stderr() -> Observer {
    let start = Instant::now();
    let mut request = None;
    Box::new(move |seen: &Seen| {
        eprintln!("{}", line(seen, start, request.as_deref()));
        if seen.direction == Direction::Request {
            request = seen.framing.open(&seen.bytes).map(|(_, pdu)| pdu);
        }
    })
}

/// Returns a frame as a line: seconds since `start`, direction, bytes, words.
pub fn line(seen: &Seen, start: Instant, request: Option<&[u8]>) -> String {
    let seconds = seen.at.saturating_duration_since(start).as_secs_f64();
    let frame = frame(seen.direction, seen.framing, &seen.bytes, request);
    format!("{seconds:9.3} {frame}")
}

/// Returns a frame as a line: direction, bytes, words. `request` is the PDU of the request before a response.
pub fn frame(
    direction: Direction,
    framing: Framing,
    bytes: &[u8],
    request: Option<&[u8]>,
) -> String {
    let arrow = match direction {
        Direction::Request => "->",
        Direction::Response => "<-",
    };
    format!(
        "{arrow} {}  {}",
        adu::bytes(framing, bytes),
        decode::frame(framing, direction, bytes, request),
    )
}
