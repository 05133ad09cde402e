//! Reads and writes points of any unit on the line, and restores outputs.

use crate::bench_file::Place;
use conformance::bench::Bench;
use conformance::case::Check;
use conformance::frame::Reply;
use conformance::points::{pdu, words_of};
use conformance::target::Target;

/// Number of attempts to restore an output.
const ATTEMPTS: u32 = 3;

/// Reads a bit by function 01, as an output, or 02, as an input.
pub(super) fn read_bit(bench: &mut Bench<'_>, function: u8, place: Place) -> Check<bool> {
    let request = pdu(function, place.point, 1);
    let right = |pdu: &[u8]| matches!(pdu, [_, 1, 0 | 1]);
    Ok(ask(bench, place, &request, right)?[2] == 1)
}

/// Switches an output by function 05.
pub(super) fn write_bit(bench: &mut Bench<'_>, place: Place, on: bool) -> Check {
    let request = pdu(5, place.point, if on { 0xFF00 } else { 0 });
    ask(bench, place, &request, |reply| reply == request).map(drop)
}

/// Reads a point by function 03, as an output, or 04, as an input.
pub(super) fn read_word(bench: &mut Bench<'_>, function: u8, place: Place) -> Check<u16> {
    let request = pdu(function, place.point, 1);
    let right = |pdu: &[u8]| matches!(pdu, [_, 2, _, _]);
    Ok(words_of(&ask(bench, place, &request, right)?)[0])
}

/// Sets an output by function 06.
pub(super) fn write_word(bench: &mut Bench<'_>, place: Place, value: u16) -> Check {
    let request = pdu(6, place.point, value);
    ask(bench, place, &request, |reply| reply == request).map(drop)
}

/// Reads registers of a unit by function 03.
pub(super) fn registers(
    bench: &mut Bench<'_>,
    unit: u8,
    first: u16,
    count: u16,
) -> Check<Vec<u16>> {
    let request = pdu(3, first, count);
    let right = |pdu: &[u8]| pdu.len() == 2 + 2 * usize::from(count);
    let place = Place { unit, point: first };
    Ok(words_of(&ask(bench, place, &request, right)?))
}

/// Restores an output by calling `write`, and repeats a failed attempt: one lost frame must not leave the output
/// changed.
pub(super) fn put_back(mut write: impl FnMut() -> Check) -> Check {
    let mut done = write();
    for _ in 1..ATTEMPTS {
        if done.is_err() {
            done = write();
        }
    }
    done
}

/// Sends a request to a unit on the line. Returns the reply if it is right.
fn ask(
    bench: &mut Bench<'_>,
    place: Place,
    request: &[u8],
    right: impl Fn(&[u8]) -> bool,
) -> Check<Vec<u8>> {
    let target = Target {
        unit: place.unit,
        ..bench.target.clone()
    };
    let mut other = Bench::new(bench.endpoint, &target);
    match other.ask(request)? {
        Reply::Pdu(reply) if reply[0] == request[0] && right(&reply) => Ok(reply),
        Reply::Silence => other.fail(format!("an answer from unit {}", place.unit)),
        _ if matches!(request[0], 2 | 4) => other.fail(format!("an input at {place}")),
        _ if matches!(request[0], 3) => other.fail(format!("registers at {place}")),
        _ => other.fail(format!("an output at {place}")),
    }
}
