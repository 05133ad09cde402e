//! Damaged characters, breaks and glitches.

use std::time::Duration;

use crate::case::{Case, Check, Need, case};
use crate::endpoint::Piece;
use crate::frame::Reply;
use crate::tester::{Tester, damaged_at};

const N: &[Need] = &[Need::Rtu, Need::Faults];

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("damage/framing-error", "V1.02 2.5.1.1",
        "a character with a low stop bit spoils its frame, and that one only", N, framing_error),
    case("damage/parity-error", "V1.02 2.5.1", "a character with wrong parity spoils its frame, and that one only",
        &[Need::Rtu, Need::Faults, Need::Parity], parity_error),
    case("damage/parity-error-broadcast", "V1.02 2.5.1", "a broadcast write with a damaged character is not done",
        &[Need::Rtu, Need::Faults, Need::Bits, Need::Function(1), Need::Function(5)], damaged_write),
    case("damage/break", "V1.02 2.5.1.1", "a break costs no later request", N, line_break),
    case("damage/glitch", "V1.02 2.5.1.1", "short glitches on the idle line cost no later request", N,
        glitch).interpretation(),
    case("damage/noise-behind-a-frame", "V1.02 2.5.1.1",
        "pulses below half a bit after a request delay its reply by one character at most",
        &[Need::Rtu, Need::Exact, Need::Faults, Need::Driver], noise_behind).interpretation(),
];

/// Damages each character of a request in turn. The unit is silent to that request, and answers the next one.
pub(super) fn one_by_one(tester: &mut Tester<'_>, damaged: fn(u8) -> Piece) -> Check {
    let frame = tester.ping();
    for index in 0..frame.len() {
        let pieces = damaged_at(&frame, index, damaged);
        tester.silence(&pieces, "a damaged character spoils its frame")?;
        tester.alive("a damaged character")?;
    }
    Ok(())
}

fn framing_error(tester: &mut Tester<'_>) -> Check {
    one_by_one(tester, Piece::BadStop)
}

fn parity_error(tester: &mut Tester<'_>) -> Check {
    one_by_one(tester, Piece::BadParity)
}

fn damaged_write(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?.up_to(1);
    tester.set_bits(span.first, &[false])?;
    let [high, low] = span.first.to_be_bytes();
    let frame = tester.target.mode.frame(0, &[5, high, low, 0xFF, 0]);
    for index in 0..frame.len() {
        let pieces = damaged_at(&frame, index, Piece::BadStop);
        tester.silence(&pieces, "a broadcast")?;
    }
    tester.is_off(span)
}

fn line_break(tester: &mut Tester<'_>) -> Check {
    for bits in [10, 12, 15] {
        tester.silence(&[Piece::Break(bits)], "a break is no request")?;
        tester.alive("a break")?;
    }
    tester.silence(
        &[Piece::Break(15), Piece::Break(15), Piece::Break(15)],
        "breaks are no request",
    )?;
    tester.alive("breaks")
}

fn glitch(tester: &mut Tester<'_>) -> Check {
    let bit = tester.endpoint.line().bits(1);
    let apart = Piece::Gap(tester.endpoint.line().t35_limits().most * 2 + bit * 12);
    for width in [Duration::from_micros(1), bit / 20, bit / 4, bit * 2 / 5] {
        let width = width.max(Duration::from_nanos(100));
        let ping = Piece::Bytes(tester.ping());
        let wanted = format!("a reply after a glitch of {width:?}");
        tester.answers(&[Piece::Glitch(width), apart.clone(), ping], wanted)?;
    }
    Ok(())
}

/// Sends a request and pulses after it. Returns the reply, and the time from the end of the request to the moment
/// when the unit switches its driver on. Pulses during the reply would hide its first start bit.
fn turnaround(tester: &mut Tester<'_>, pulses: &[Piece]) -> Check<(Reply, Duration)> {
    let frame = tester.ping();
    let end = tester.endpoint.now() + tester.endpoint.line().characters(frame.len());
    tester.endpoint.take_driver_edges()?;
    let reply = tester.exchange(&[&[Piece::Bytes(frame)], pulses].concat())?;
    let edges = tester.endpoint.take_driver_edges()?;
    match edges.first() {
        Some((on, true)) => Ok((reply, on.saturating_sub(end))),
        _ => tester.fail("a reply: a short pulse is no character"),
    }
}

/// Pulses from `first` on, `spacing` apart, up to `last`.
fn train(width: Duration, first: Duration, spacing: Duration, last: Duration) -> Vec<Piece> {
    let mut pulses = Vec::new();
    let (mut at, mut next) = (Duration::ZERO, first);
    while next + width < last {
        pulses.extend([Piece::Gap(next - at), Piece::Glitch(width)]);
        at = next + width;
        next += spacing;
    }
    pulses
}

/// Time that an interrupt of the unit may wait for another one when its reply is due. The reply then begins up to one bit
/// later, at the next clock of the UART.
const BUSY: Duration = Duration::from_micros(5);

/// Number of times that a request with the same pulses is sent until its reply is early enough.
const TRIES: u32 = 4;
/// How much later in a millisecond each further try begins.
const SHIFT: Duration = Duration::from_micros(237);
const MILLISECOND: Duration = Duration::from_millis(1);

/// Sends a request and pulses after it, as [`turnaround`] does, until the reply takes at most this time.
///
/// Other work of the unit, such as the scan of its modules, holds up replies that are due at the same instant, whether
/// there are pulses or not. Usually it recurs every millisecond. Pulses that delay a reply delay it at any instant.
fn least_turnaround(
    tester: &mut Tester<'_>,
    pulses: &[Piece],
    most: Duration,
) -> Check<(Reply, Duration)> {
    let begun = tester.endpoint.now();
    let mut last = turnaround(tester, pulses)?;
    for n in 1..TRIES {
        if last.1 <= most {
            break;
        }
        let passed =
            tester.endpoint.now().saturating_sub(begun).as_nanos() % MILLISECOND.as_nanos();
        tester.rest(MILLISECOND + SHIFT * n - Duration::from_nanos(passed as u64))?;
        last = turnaround(tester, pulses)?;
    }
    Ok(last)
}

fn noise_behind(tester: &mut Tester<'_>) -> Check {
    let line = tester.endpoint.line();
    let bit = line.bits(1);
    let mut undisturbed = Duration::MAX;
    for _ in 0..5 {
        undisturbed = undisturbed.min(turnaround(tester, &[])?.1);
    }
    let most = undisturbed + line.characters(1) + bit + BUSY;
    let silence = line.t35_limits().least;
    for width in [bit / 20, bit * 2 / 5] {
        let width = width.max(Duration::from_nanos(100));
        for spacing in [
            bit * 2,
            bit * 5,
            bit * 9,
            bit * 11,
            bit * 13,
            bit * 23,
            silence,
        ] {
            for first in [bit, bit * 4, bit * 8] {
                // Pulses that end before the reply may start, and pulses that continue while it is due.
                for last in [silence - bit * 3, most + line.characters(2)] {
                    let pulses = train(width, first, spacing, last);
                    let (reply, took) = least_turnaround(tester, &pulses, most)?;
                    tester.ensure(
                        took <= most,
                        format!(
                            "a reply {most:?} after the request or earlier, not {took:?}: without pulses it takes {undisturbed:?}"
                        ),
                    )?;
                    // Pulses during the reply damage the reply at the master.
                    let right = tester.is_pong(&reply) || last > silence;
                    tester.ensure(right, "a good reply")?;
                }
            }
        }
    }
    tester.alive("pulses after requests")
}
