//! Diagnostics, function 08: echo, restart, listen-only mode and counters.

use super::dispatch::unknown_function;
use super::line_counters;
use crate::bench::Bench;
use crate::case::{Case, Check, Need, case, skip};
use crate::frame::Reply;
use crate::points::diagnose;

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

fn echo(bench: &mut Bench<'_>) -> Check {
    let odd: &[u16] = match bench.target.modio {
        Some(_) => &[0, 1, 3, 17, 249],
        None => &[],
    };
    for length in [2, 4, 128, 250].iter().chain(odd).copied() {
        let data: Vec<u8> = (0..length).map(|n| (n as u8).wrapping_mul(37)).collect();
        let request = diagnose(0, &data);
        bench.reply_is(&request, &request)?;
    }
    Ok(())
}

fn unknown(bench: &mut Bench<'_>) -> Check {
    for sub in [0x05, 0x09, 0x13, 0x15, 0x16, 0xFF, 0x0100, 0x0A00, 0xFFFF] {
        bench.exception(&diagnose(sub, &[0, 0]), 1)?;
    }
    Ok(())
}

fn data(bench: &mut Bench<'_>) -> Check {
    let refused = data_refused(bench);
    // A faulty unit may have entered listen-only mode by a bad 04. End that mode, so that later cases are not affected.
    bench.ask(&diagnose(1, &[0, 0]))?;
    refused?;
    bench.alive("diagnostics with bad data")
}

fn data_refused(bench: &mut Bench<'_>) -> Check {
    for sub in [
        0x02, 0x04, 0x0A, 0x0B, 0x0C, 0x0D, 0x0E, 0x0F, 0x10, 0x11, 0x12, 0x14,
    ] {
        for bad in [[0, 1], [1, 0], [0xFF, 0]] {
            let reply = bench.ask_due(&diagnose(sub, &bad))?;
            if reply.exception(8) == Some(1) {
                break;
            }
            let wanted = format!("exception 03: 08/{sub:02X} takes 0000 only");
            bench.ensure(reply.exception(8) == Some(3), wanted)?;
        }
        for short in [&[][..], &[0], &[0, 0, 0]] {
            let reply = bench.ask(&diagnose(sub, short))?;
            let right = reply == Reply::Silence || matches!(reply.exception(8), Some(1 | 3));
            let wanted = format!("exception 03 or silence: 08/{sub:02X} takes two bytes");
            bench.ensure(right, wanted)?;
        }
    }
    Ok(())
}

fn length(bench: &mut Bench<'_>) -> Check {
    bench.exception_03_or_silence(&[8])?;
    bench.exception_03_or_silence(&[8, 0])
}

fn register(bench: &mut Bench<'_>) -> Check {
    let reply = bench.reply_unless_lacking(&diagnose(2, &[0, 0]), "08/02")?;
    let wanted = "08 00 02 and two bytes";
    bench.ensure(reply.len() == 5 && reply[..3] == [8, 0, 2], wanted)
}

fn restart(bench: &mut Bench<'_>) -> Check {
    bench.reply_unless_lacking(&diagnose(1, &[0, 0]), "08/01")?;
    for data in [[0, 0], [0xFF, 0]] {
        let exceptions = diagnose(0x0D, &[0, 0]);
        let counts = bench.ask_due(&exceptions)?.exception(8) != Some(1);
        if let Some(function) = super::dispatch::unknown_functions(bench).pop() {
            bench.exception(&[function], 1)?;
        }
        let request = diagnose(1, &data);
        bench.reply_is(&request, &request)?;
        bench.alive("a restart of the communication")?;
        if counts {
            // When the counter is 0, the reply is equal to the request.
            bench.reply_is(&exceptions, &exceptions)?;
        }
    }
    for bad in [[0, 1], [0xFF, 1], [0xFE, 0], [0xFF, 0xFF]] {
        bench.exception(&diagnose(1, &bad), 3)?;
    }
    bench.exception_03_or_silence(&diagnose(1, &[]))?;
    bench.exception_03_or_silence(&diagnose(1, &[0, 0, 0]))
}

fn delimiter_in_rtu(bench: &mut Bench<'_>) -> Check {
    let request = diagnose(3, b"!\0");
    let reply = bench.ask_due(&request)?;
    let refused = reply.exception(8) == Some(1);
    if bench.target.modio.is_some() {
        bench.ensure(refused, "exception 01: there is no delimiter in RTU")?;
    }
    let right = refused || reply == Reply::Pdu(request.clone());
    bench.ensure(right, "exception 01, or the request echoed")?;
    bench.alive("08/03 in RTU")?;
    if !refused {
        let back = diagnose(3, b"\n\0");
        bench.reply_is(&back, &back)?;
    }
    Ok(())
}

/// Skips the case where the unit has no listen-only mode.
pub(super) fn needs_listen_only(bench: &mut Bench<'_>) -> Check {
    // Data that the unit refuses shows whether it has the sub-function, without entering the mode.
    let reply = bench.ask_due(&diagnose(4, &[0, 1]))?;
    if reply.exception(8) == Some(1) {
        return skip("the unit answers 01: it has no 08/04");
    }
    Ok(())
}

/// Puts the unit into listen-only mode.
pub(super) fn enter(bench: &mut Bench<'_>) -> Check {
    bench.silence_of(bench.unit(), &diagnose(4, &[0, 0]), "08/04 is not answered")
}

/// Ends the listen-only mode, also after a failure. Returns that failure, or the failure to end the mode.
fn leave(bench: &mut Bench<'_>, so_far: Check) -> Check {
    let reply = bench.ask(&diagnose(1, &[0, 0]))?;
    let out = match so_far {
        Ok(()) => bench.ensure(
            reply == Reply::Silence,
            "silence: 08/01 in listen-only mode is obeyed without reply",
        ),
        failed => failed,
    };
    // A second restart has no effect on a unit that has left the mode.
    bench.ask(&diagnose(1, &[0, 0]))?;
    out.and(bench.alive("08/01 has ended the listen-only mode"))
}

fn listen_only(bench: &mut Bench<'_>) -> Check {
    needs_listen_only(bench)?;
    enter(bench)?;
    let ping = bench.ping();
    let mut silent = bench.silence_to(&ping, "in listen-only mode nothing is answered");
    for pdu in [
        diagnose(0, &[1, 2]),
        diagnose(4, &[0, 0]),
        diagnose(0x0A, &[0, 0]),
        vec![0x66],
        vec![3, 0, 0, 0, 0],
    ] {
        silent = silent.and_then(|()| bench.silence_of(bench.unit(), &pdu, "listen-only mode"));
    }
    leave(bench, silent)
}

fn listen_only_writes(bench: &mut Bench<'_>) -> Check {
    let span = bench.bits()?.up_to(1);
    bench.set_bits(span.first, &[false])?;
    needs_listen_only(bench)?;
    enter(bench)?;
    let [high, low] = span.first.to_be_bytes();
    let mut tried = Ok(());
    for unit in [bench.unit(), 0] {
        for pdu in [
            vec![5, high, low, 0xFF, 0],
            vec![0x0F, high, low, 0, 1, 1, 1],
        ] {
            tried = tried.and_then(|()| bench.silence_of(unit, &pdu, "listen-only mode"));
        }
    }
    leave(bench, tried)?;
    bench.is_off(span)
}

fn clear(bench: &mut Bench<'_>) -> Check {
    let request = diagnose(0x0A, &[0, 0]);
    let reply = bench.reply_unless_lacking(&request, "08/0A")?;
    bench.ensure(reply == request, "the request echoed")?;
    let function = unknown_function(bench)?;
    // The request after the clearing moves the counters 0B and 0E by one.
    for sub in (0x0B..=0x12).chain([2]) {
        let moved = u16::from(matches!(sub, 0x0B | 0x0E));
        // Move every counter that traffic on the line can move.
        for _ in 0..2 {
            bench.alive("a request that clears the counters")?;
            let bad = line_counters::bad(bench);
            bench.silence_to(&bad, "its check is wrong")?;
            bench.exception(&[function], 1)?;
            bench.silent_ping(0, "a broadcast")?;
        }
        let again = diagnose(0x0A, &[0, 0]);
        bench.reply_is(&again, &again)?;
        let reply = bench.ask_due(&diagnose(sub, &[0, 0]))?;
        if reply.exception(8) == Some(1) {
            continue;
        }
        let Reply::Pdu(pdu) = reply else {
            return bench.fail(format!("a reply to 08/{sub:02X}"));
        };
        let value = pdu
            .get(3..5)
            .map(|word| u16::from_be_bytes([word[0], word[1]]));
        let right = value.is_some_and(|value| value <= moved);
        let wanted = format!("08/{sub:02X} is {moved} at most after 08/0A");
        bench.ensure(right, wanted)?;
    }
    Ok(())
}

fn clear_overruns(bench: &mut Bench<'_>) -> Check {
    let request = diagnose(0x14, &[0, 0]);
    let reply = bench.reply_unless_lacking(&request, "08/14")?;
    bench.ensure(reply == request, "the request echoed")?;
    let overruns = bench.reply_unless_lacking(&diagnose(0x12, &[0, 0]), "08/12")?;
    let wanted = "the overrun counter is 0";
    bench.ensure(overruns == diagnose(0x12, &[0, 0]), wanted)
}
