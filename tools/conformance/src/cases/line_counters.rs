//! The counters of the serial line: sub-functions 0B to 12 of function 08, and the registers of a modio for them.

use register_map::state;

use crate::case::{Case, Check, Need, Stop, case, skip};
use crate::cases::dispatch::unknown_function;
use crate::endpoint::Piece;
use crate::points::{diagnose, pdu};
use crate::tester::{Tester, damaged_at};

const S: &str = "V1.02 appendix A";

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("counters/bus-messages", S, "0B counts every good message on the bus, for any address", &[], bus_messages),
    case("counters/bus-errors", S, "0C counts frames with a bad check, nothing else", &[], bus_errors),
    case("counters/bus-errors-short", S, "0C counts frames of fewer than 3 bytes", &[Need::Rtu], short_frames),
    case("counters/bus-errors-characters", S, "0C counts a frame with a damaged character once",
        &[Need::Faults, Need::Rtu], damaged_characters),
    case("counters/exceptions", S, "0D counts exceptions, those to broadcasts too", &[], exceptions),
    case("counters/unit-messages", S, "0E counts messages for this unit, and broadcasts", &[], unit_messages),
    case("counters/no-response", S, "0F counts messages without a response, broadcasts included", &[], no_response),
    case("counters/nak-busy-overrun", S, "10, 11 and 12 do not move by ordinary traffic", &[], others),
    case("counters/registers", "map, 0x0230", "a modio's registers are the counters of 08",
        &[Need::Modio, Need::Function(8)], registers),
];

/// Reads a counter by function 08, or by a modio's register. The counter includes this request.
pub(super) fn count(tester: &mut Tester<'_>, sub: u16) -> Check<u16> {
    if tester.target.has(8) {
        let reply = tester.reply_unless_lacking(&diagnose(sub, &[0, 0]), "such a counter")?;
        let [8, _, echoed, high, low] = reply[..] else {
            return tester.fail("08, the sub-function, two bytes");
        };
        tester.ensure(u16::from(echoed) == sub, "the sub-function again")?;
        return Ok(u16::from_be_bytes([high, low]));
    }
    if tester.target.modio.is_some() {
        return tester.read_word(state::BUS_MESSAGES + (sub - 0x0B));
    }
    skip("the unit has no line counters")
}

/// Checks by how much a counter moves while `done` runs. `wanted` includes the request that reads the counter, if the
/// counter counts such a request.
fn moves(
    tester: &mut Tester<'_>,
    sub: u16,
    wanted: u16,
    what: &str,
    mut done: impl FnMut(&mut Tester<'_>) -> Check,
) -> Check {
    let before = count(tester, sub)?;
    done(tester)?;
    let after = count(tester, sub)?;
    let moved = after.wrapping_sub(before);
    let must = format!("counter {sub:02X} has moved by {wanted} ({what}), not by {moved}");
    tester.ensure(moved == wanted, must)
}

fn ping_other(tester: &mut Tester<'_>) -> Check {
    tester.silent_ping(tester.other(), "another unit's request")
}

/// Sends a broadcast that the unit refuses in silence, and that writes nothing.
fn refused_broadcast(tester: &mut Tester<'_>) -> Check {
    let function = [6, 5, 0x10].into_iter().find(|f| tester.target.has(*f));
    let Some(function) = function else {
        return skip("the unit has no function to broadcast");
    };
    let Some(nowhere) = tester.target.nowhere_to_write(function) else {
        return skip("every address exists");
    };
    let mut request = pdu(function, nowhere, 0);
    if function == 0x10 {
        request = crate::points::write_words(nowhere, &[0]);
    }
    tester.silence_of(0, &request, "a broadcast")
}

/// Returns a request whose check is wrong.
pub(super) fn bad(tester: &Tester<'_>) -> Vec<u8> {
    let mut frame = tester.ping();
    let digit = frame.len() - 3;
    // In ASCII this is the last digit of the LRC, in RTU the last data byte.
    frame[digit] = if frame[digit] == b'0' { b'1' } else { b'0' };
    frame
}

fn bus_messages(tester: &mut Tester<'_>) -> Check {
    let what = "2 for this unit, 3 for another, 1 to read it";
    moves(tester, 0x0B, 6, what, |tester| {
        for _ in 0..3 {
            ping_other(tester)?;
        }
        tester.alive("others' requests")?;
        let frame = bad(tester);
        tester.silence_to(&frame, "the check is wrong")?;
        tester.alive("a frame with a wrong check")
    })
}

fn bus_errors(tester: &mut Tester<'_>) -> Check {
    moves(tester, 0x0C, 3, "3 frames with a bad check", |tester| {
        let frame = bad(tester);
        for _ in 0..3 {
            tester.silence_to(&frame, "the check is wrong")?;
        }
        ping_other(tester)?;
        tester.alive("frames with a wrong check")
    })
}

fn short_frames(tester: &mut Tester<'_>) -> Check {
    moves(tester, 0x0C, 2, "frames of 1 and 2 bytes", |tester| {
        tester.silence_to(&[0x55], "noise")?;
        tester.silence_to(&[tester.unit(), 3], "noise")
    })
}

fn damaged_characters(tester: &mut Tester<'_>) -> Check {
    let what = "1 frame with a damaged character";
    moves(tester, 0x0C, 1, what, |tester| {
        let pieces = damaged_at(&tester.ping(), 2, Piece::BadStop);
        tester.silence(&pieces, "a stop bit is low")
    })
}

fn exceptions(tester: &mut Tester<'_>) -> Check {
    let function = unknown_function(tester)?;
    moves(tester, 0x0D, 2, "2 exceptions", |tester| {
        tester.exception(&[function], 1)?;
        tester.exception(&[function, 1, 2], 1)?;
        ping_other(tester)?;
        tester.alive("exceptions")
    })?;
    let what = "1 broadcast that is refused";
    moves(tester, 0x0D, 1, what, refused_broadcast)
}

fn unit_messages(tester: &mut Tester<'_>) -> Check {
    moves(tester, 0x0E, 3, "2 and 1 to read it", |tester| {
        ping_other(tester)?;
        tester.alive("another's request")?;
        tester.alive("a request")?;
        let frame = bad(tester);
        tester.silence_to(&frame, "the check is wrong")
    })?;
    let what = "1 broadcast and 1 to read it";
    moves(tester, 0x0E, 2, what, refused_broadcast)
}

fn no_response(tester: &mut Tester<'_>) -> Check {
    moves(
        tester,
        0x0F,
        0,
        "everything for it was answered",
        |tester| {
            ping_other(tester)?;
            tester.alive("another's request")
        },
    )?;
    moves(tester, 0x0F, 2, "2 broadcasts", |tester| {
        refused_broadcast(tester)?;
        refused_broadcast(tester)
    })
}

fn others(tester: &mut Tester<'_>) -> Check {
    let mut lacking = Ok(());
    let mut has_one = false;
    for sub in [0x10, 0x11, 0x12] {
        let moved = moves(tester, sub, 0, "ordinary traffic", |tester| {
            for _ in 0..3 {
                ping_other(tester)?;
                tester.alive("another's request")?;
            }
            Ok(())
        });
        match moved {
            Ok(()) => has_one = true,
            skipped @ Err(Stop::Skip(_)) => lacking = skipped,
            failed => return failed,
        }
    }
    if has_one { Ok(()) } else { lacking }
}

fn registers(tester: &mut Tester<'_>) -> Check {
    for sub in 0x0B..=0x12_u16 {
        let by_function = count(tester, sub)?;
        let register = state::BUS_MESSAGES + (sub - 0x0B);
        let by_register = tester.read_word(register)?;
        // A request to read moves the counters 0B and 0E by one.
        let moved = u16::from(matches!(sub, 0x0B | 0x0E));
        let wanted = format!(
            "register {register:04X} is the counter 08/{sub:02X}: {by_function} and {moved}"
        );
        tester.ensure(by_register == by_function.wrapping_add(moved), wanted)?;
    }
    let reply = tester.reply(&pdu(3, state::BUS_MESSAGES, 8))?;
    tester.ensure(reply.len() == 18, "eight registers")
}
