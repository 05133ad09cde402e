//! Diagnostics, function 08: echo, restart, listen-only mode and counters.

use super::dispatch::unknown_function;
use super::line_counters;
use crate::case::{Case, Check, Need, case, skip};
use crate::frame::Reply;
use crate::points::diagnose;
use crate::tester::Tester;

const N: &[Need] = &[Need::Function(8)];

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("fc08/echo", "V1.1b3 6.8.1, 00",
        "sub-function 00 returns its data, any number of words; a modio's any number of bytes", N, echo),
    case("fc08/unknown-sub-function", "V1.1b3 6.8", "a sub-function that the unit does not have is exception 01", N,
        unknown),
    case("fc08/data", "V1.1b3 6.8.1", "data other than 0000 where 0000 is required is exception 03", N, data),
    case("fc08/length", "V1.1b3 6.8", "a request without a whole sub-function is 03 or silence", N,
        length).interpretation(),
    case("fc08/register", "V1.1b3 6.8.1, 02", "sub-function 02 gives the diagnostic register", N, register),
    case("fc08/restart", "V1.1b3 6.8.1, 01",
        "sub-function 01 echoes 0000 and FF00, clears the counters and goes on, anything else is 03", N, restart),
    case("fc08/delimiter-in-rtu", "V1.1b3 6.8.1, 03",
        "in RTU sub-function 03 has no effect: it is exception 01 or echoed; on a modio 01",
        &[Need::Function(8), Need::Rtu], delimiter_in_rtu).interpretation(),
    case("fc08/listen-only", "V1.1b3 6.8.1, 04",
        "04 is not answered; then nothing is, nor done, but 01, which ends it, itself without reply", N, listen_only),
    case("fc08/listen-only-writes", "V1.1b3 6.8.1, 04",
        "in listen-only mode nothing is written, not by broadcast either",
        &[Need::Function(8), Need::Function(1), Need::Bits], listen_only_writes),
    case("fc08/clear-counters", "V1.1b3 6.8.1, 0A", "0A sets every counter and the diagnostic register to 0", N,
        clear),
    case("fc08/clear-overruns", "V1.1b3 6.8.1, 14", "14 is echoed, and the overrun counter is 0 after it", N,
        clear_overruns),
];

fn echo(tester: &mut Tester<'_>) -> Check {
    let odd: &[u16] = match tester.target.modio {
        Some(_) => &[0, 1, 3, 17, 249],
        None => &[],
    };
    for length in [2, 4, 128, 250].iter().chain(odd).copied() {
        let data: Vec<u8> = (0..length).map(|n| (n as u8).wrapping_mul(37)).collect();
        let request = diagnose(0, &data);
        tester.reply_is(&request, &request)?;
    }
    Ok(())
}

fn unknown(tester: &mut Tester<'_>) -> Check {
    for sub in [0x05, 0x09, 0x13, 0x15, 0x16, 0xFF, 0x0100, 0x0A00, 0xFFFF] {
        tester.exception(&diagnose(sub, &[0, 0]), 1)?;
    }
    Ok(())
}

fn data(tester: &mut Tester<'_>) -> Check {
    let refused = data_refused(tester);
    // A faulty unit may have entered listen-only mode by a bad 04. End that mode, so that later cases are not affected.
    tester.ask(&diagnose(1, &[0, 0]))?;
    refused?;
    tester.alive("diagnostics with bad data")
}

fn data_refused(tester: &mut Tester<'_>) -> Check {
    for sub in [
        0x02, 0x04, 0x0A, 0x0B, 0x0C, 0x0D, 0x0E, 0x0F, 0x10, 0x11, 0x12, 0x14,
    ] {
        for bad in [[0, 1], [1, 0], [0xFF, 0]] {
            let reply = tester.ask_due(&diagnose(sub, &bad))?;
            if reply.exception(8) == Some(1) {
                break;
            }
            let wanted = format!("exception 03: 08/{sub:02X} takes 0000 only");
            tester.ensure(reply.exception(8) == Some(3), wanted)?;
        }
        for short in [&[][..], &[0], &[0, 0, 0]] {
            let reply = tester.ask(&diagnose(sub, short))?;
            let right = reply == Reply::Silence || matches!(reply.exception(8), Some(1 | 3));
            let wanted = format!("exception 03 or silence: 08/{sub:02X} takes two bytes");
            tester.ensure(right, wanted)?;
        }
    }
    Ok(())
}

fn length(tester: &mut Tester<'_>) -> Check {
    tester.exception_03_or_silence(&[8])?;
    tester.exception_03_or_silence(&[8, 0])
}

fn register(tester: &mut Tester<'_>) -> Check {
    let reply = tester.reply_unless_lacking(&diagnose(2, &[0, 0]), "08/02")?;
    let wanted = "08 00 02 and two bytes";
    tester.ensure(reply.len() == 5 && reply[..3] == [8, 0, 2], wanted)
}

fn restart(tester: &mut Tester<'_>) -> Check {
    tester.reply_unless_lacking(&diagnose(1, &[0, 0]), "08/01")?;
    for data in [[0, 0], [0xFF, 0]] {
        let exceptions = diagnose(0x0D, &[0, 0]);
        let counts = tester.ask_due(&exceptions)?.exception(8) != Some(1);
        if let Some(function) = super::dispatch::unknown_functions(tester).pop() {
            tester.exception(&[function], 1)?;
        }
        let request = diagnose(1, &data);
        tester.reply_is(&request, &request)?;
        tester.alive("a restart of the communication")?;
        if counts {
            // When the counter is 0, the reply is equal to the request.
            tester.reply_is(&exceptions, &exceptions)?;
        }
    }
    for bad in [[0, 1], [0xFF, 1], [0xFE, 0], [0xFF, 0xFF]] {
        tester.exception(&diagnose(1, &bad), 3)?;
    }
    tester.exception_03_or_silence(&diagnose(1, &[]))?;
    tester.exception_03_or_silence(&diagnose(1, &[0, 0, 0]))
}

fn delimiter_in_rtu(tester: &mut Tester<'_>) -> Check {
    let request = diagnose(3, b"!\0");
    let reply = tester.ask_due(&request)?;
    let refused = reply.exception(8) == Some(1);
    if tester.target.modio.is_some() {
        tester.ensure(refused, "exception 01: there is no delimiter in RTU")?;
    }
    let right = refused || reply == Reply::Pdu(request.clone());
    tester.ensure(right, "exception 01, or the request echoed")?;
    tester.alive("08/03 in RTU")?;
    if !refused {
        let back = diagnose(3, b"\n\0");
        tester.reply_is(&back, &back)?;
    }
    Ok(())
}

/// Skips the case where the unit has no listen-only mode.
pub(super) fn needs_listen_only(tester: &mut Tester<'_>) -> Check {
    // Data that the unit refuses shows whether it has the sub-function, without entering the mode.
    let reply = tester.ask_due(&diagnose(4, &[0, 1]))?;
    if reply.exception(8) == Some(1) {
        return skip("the unit answers 01: it has no 08/04");
    }
    Ok(())
}

/// Puts the unit into listen-only mode.
pub(super) fn enter(tester: &mut Tester<'_>) -> Check {
    tester.silence_of(
        tester.unit(),
        &diagnose(4, &[0, 0]),
        "08/04 is not answered",
    )
}

/// Ends the listen-only mode, also after a failure. Returns that failure, or the failure to end the mode.
fn leave(tester: &mut Tester<'_>, so_far: Check) -> Check {
    let reply = tester.ask(&diagnose(1, &[0, 0]))?;
    let out = match so_far {
        Ok(()) => tester.ensure(
            reply == Reply::Silence,
            "silence: 08/01 in listen-only mode is obeyed without reply",
        ),
        failed => failed,
    };
    // A second restart has no effect on a unit that has left the mode.
    tester.ask(&diagnose(1, &[0, 0]))?;
    out.and(tester.alive("08/01 has ended the listen-only mode"))
}

fn listen_only(tester: &mut Tester<'_>) -> Check {
    needs_listen_only(tester)?;
    enter(tester)?;
    let ping = tester.ping();
    let mut silent = tester.silence_to(&ping, "in listen-only mode nothing is answered");
    for pdu in [
        diagnose(0, &[1, 2]),
        diagnose(4, &[0, 0]),
        diagnose(0x0A, &[0, 0]),
        vec![0x66],
        vec![3, 0, 0, 0, 0],
    ] {
        silent = silent.and_then(|()| tester.silence_of(tester.unit(), &pdu, "listen-only mode"));
    }
    leave(tester, silent)
}

fn listen_only_writes(tester: &mut Tester<'_>) -> Check {
    let span = tester.bits()?.up_to(1);
    tester.set_bits(span.first, &[false])?;
    needs_listen_only(tester)?;
    enter(tester)?;
    let [high, low] = span.first.to_be_bytes();
    let mut tried = Ok(());
    for unit in [tester.unit(), 0] {
        for pdu in [
            vec![5, high, low, 0xFF, 0],
            vec![0x0F, high, low, 0, 1, 1, 1],
        ] {
            tried = tried.and_then(|()| tester.silence_of(unit, &pdu, "listen-only mode"));
        }
    }
    leave(tester, tried)?;
    tester.is_off(span)
}

fn clear(tester: &mut Tester<'_>) -> Check {
    let request = diagnose(0x0A, &[0, 0]);
    let reply = tester.reply_unless_lacking(&request, "08/0A")?;
    tester.ensure(reply == request, "the request echoed")?;
    let function = unknown_function(tester)?;
    // The request after the clearing moves the counters 0B and 0E by one.
    for sub in (0x0B..=0x12).chain([2]) {
        let moved = u16::from(matches!(sub, 0x0B | 0x0E));
        // Move every counter that traffic on the line can move.
        for _ in 0..2 {
            tester.alive("a request that clears the counters")?;
            let bad = line_counters::bad(tester);
            tester.silence_to(&bad, "its check is wrong")?;
            tester.exception(&[function], 1)?;
            tester.silent_ping(0, "a broadcast")?;
        }
        let again = diagnose(0x0A, &[0, 0]);
        tester.reply_is(&again, &again)?;
        let reply = tester.ask_due(&diagnose(sub, &[0, 0]))?;
        if reply.exception(8) == Some(1) {
            continue;
        }
        let Reply::Pdu(pdu) = reply else {
            return tester.fail(format!("a reply to 08/{sub:02X}"));
        };
        let value = pdu
            .get(3..5)
            .map(|word| u16::from_be_bytes([word[0], word[1]]));
        let right = value.is_some_and(|value| value <= moved);
        let wanted = format!("08/{sub:02X} is {moved} at most after 08/0A");
        tester.ensure(right, wanted)?;
    }
    Ok(())
}

fn clear_overruns(tester: &mut Tester<'_>) -> Check {
    let request = diagnose(0x14, &[0, 0]);
    let reply = tester.reply_unless_lacking(&request, "08/14")?;
    tester.ensure(reply == request, "the request echoed")?;
    let overruns = tester.reply_unless_lacking(&diagnose(0x12, &[0, 0]), "08/12")?;
    let wanted = "the overrun counter is 0";
    tester.ensure(overruns == diagnose(0x12, &[0, 0]), wanted)
}
