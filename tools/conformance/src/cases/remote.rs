//! Points of any unit on the line: the ends of the wires of a bench.

use crate::case::Check;
use crate::frame::Reply;
use crate::hil::bench_file::{Place, Wire};
use crate::points::{pdu, words_of};
use crate::target::Target;
use crate::tester::Tester;

/// Number of attempts to restore an output.
const ATTEMPTS: u32 = 3;

/// Reads the output of a wire. A bit is 0 or 1.
pub(super) fn output(tester: &mut Tester<'_>, wire: &Wire) -> Check<u16> {
    read(tester, by(wire, 1, 3), wire.from)
}

/// Reads the input of a wire.
pub(super) fn input(tester: &mut Tester<'_>, wire: &Wire) -> Check<u16> {
    read(tester, by(wire, 2, 4), wire.to)
}

/// Sets the output of a wire.
pub(super) fn set(tester: &mut Tester<'_>, wire: &Wire, value: u16) -> Check {
    let value = by(wire, if value == 0 { 0 } else { 0xFF00 }, value);
    let request = pdu(by(wire, 5, 6), wire.from.point, value);
    ask(tester, wire.from, &request, |reply| reply == request).map(drop)
}

/// Restores the output of a wire. A failed attempt is repeated: one lost frame must not leave the output changed.
pub(super) fn restore(tester: &mut Tester<'_>, wire: &Wire, value: u16) -> Check {
    let mut done = set(tester, wire, value);
    for _ in 1..ATTEMPTS {
        if done.is_err() {
            done = set(tester, wire, value);
        }
    }
    done
}

/// Reads registers of a unit by function 03.
pub(super) fn registers(
    tester: &mut Tester<'_>,
    unit: u8,
    first: u16,
    count: u16,
) -> Check<Vec<u16>> {
    let request = pdu(3, first, count);
    let right = |pdu: &[u8]| pdu.len() == 2 + 2 * usize::from(count);
    let place = Place { unit, point: first };
    Ok(words_of(&ask(tester, place, &request, right)?))
}

/// Returns the first value for a digital wire, the second for an analog one.
const fn by<T: Copy>(wire: &Wire, digital: T, analog: T) -> T {
    if wire.is_digital() { digital } else { analog }
}

fn read(tester: &mut Tester<'_>, function: u8, place: Place) -> Check<u16> {
    let request = pdu(function, place.point, 1);
    let right = |pdu: &[u8]| matches!(pdu, [1 | 2, 1, 0 | 1] | [3 | 4, 2, _, _]);
    let reply = ask(tester, place, &request, right)?;
    Ok(match reply[..] {
        [_, _, bit] => bit.into(),
        _ => words_of(&reply)[0],
    })
}

/// Sends a request to a unit on the line. Returns the reply if it is right.
fn ask(
    tester: &mut Tester<'_>,
    place: Place,
    request: &[u8],
    right: impl Fn(&[u8]) -> bool,
) -> Check<Vec<u8>> {
    let target = Target {
        unit: place.unit,
        ..tester.target.clone()
    };
    let mut other = Tester::new(tester.endpoint, &target);
    match other.ask(request)? {
        Reply::Pdu(reply) if reply[0] == request[0] && right(&reply) => Ok(reply),
        Reply::Silence => other.fail(format!("an answer from unit {}", place.unit)),
        _ if matches!(request[0], 2 | 4) => other.fail(format!("an input at {place}")),
        _ if request[0] == 3 => other.fail(format!("registers at {place}")),
        _ => other.fail(format!("an output at {place}")),
    }
}
