//! Exception status, event counter, event log, server identification: 07, 0B, 0C, 11.

use register_map::configuration::FORMAT;

use crate::bench::{Bench, damaged_at};
use crate::case::{Case, Check, Need, case};
use crate::cases::diagnostics;
use crate::cases::line_counters;
use crate::endpoint::Piece;
use crate::frame::hex;
use crate::points::{diagnose, pdu};

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("fc07/shape", "V1.1b3 6.7", "the reply is one byte of status", &[Need::Function(7)], exception_status),
    case("fc07/length", "V1.1b3 6.7", "a request with data is 03 or silence", &[Need::Function(7)],
        |bench| with_data(bench, 7)).interpretation(),
    case("fc0b/shape", "V1.1b3 6.9", "the reply is a status of 0000 or FFFF and a count", &[Need::Function(0x0B)],
        counter_shape),
    case("fc0b/length", "V1.1b3 6.9", "a request with data is 03 or silence", &[Need::Function(0x0B)],
        |bench| with_data(bench, 0x0B)).interpretation(),
    case("fc0b/counts", "V1.1b3 6.9", "each message done counts one; exceptions and 0B itself do not count",
        &[Need::Function(0x0B)], counter_counts),
    case("fc0c/shape", "V1.1b3 6.10", "byte count, status, event count, message count and at most 64 events",
        &[Need::Function(0x0C)], log_shape),
    case("fc0c/length", "V1.1b3 6.10", "a request with data is 03 or silence", &[Need::Function(0x0C)],
        |bench| with_data(bench, 0x0C)).interpretation(),
    case("fc0c/counts", "V1.1b3 6.10", "the log's event count is what 0B gives, the log's own reading not in it",
        &[Need::Function(0x0B), Need::Function(0x0C)], log_counts),
    case("fc0c/newest-first", "V1.1b3 6.10",
        "the newest event is first: a request received, before it the reply sent", &[Need::Function(0x0C)],
        log_order),
    case("fc0c/cleared-by-restart", "V1.1b3 6.8, 08/01",
        "08/01 with FF00 empties the log; the restart itself is event 00", &[Need::Function(8), Need::Function(0x0C)],
        log_cleared),
    case("fc0c/reply-sent", "V1.1b3 6.10", "a request that is answered is 80, received, and then 40, sent",
        &[Need::Function(0x0C)], log_reply),
    case("fc0c/exception-sent", "V1.1b3 6.10", "a reply with exception 01 to 03 is 41, read exception sent",
        &[Need::Function(0x0C)], log_exceptions),
    case("fc0c/busy-exception-sent", "V1.1b3 6.10", "a reply with exception 06 is 44, server busy exception sent",
        &[Need::Function(0x0C), Need::Function(6), Need::Modio, Need::LockClosed], log_busy),
    case("fc0c/broadcast", "V1.1b3 6.10", "a broadcast is C0, received, and then 40, done without a reply",
        &[Need::Function(0x0C)], log_broadcast),
    case("fc0c/communication-error", "V1.1b3 6.10",
        "a frame with a bad check is 82, received with a communication error", &[Need::Function(0x0C)],
        log_bad_check),
    case("fc0c/communication-error-characters", "V1.1b3 6.10",
        "a frame with a damaged character is 82, received with a communication error",
        &[Need::Function(0x0C), Need::Faults, Need::Rtu], log_bad_character),
    case("fc0c/other-units", "V1.1b3 6.10", "requests for other units are no events", &[Need::Function(0x0C)],
        log_others),
    case("fc0c/restart", "V1.1b3 6.8, 08/01", "08/01 with 0000 keeps the log and adds event 00",
        &[Need::Function(8), Need::Function(0x0C)], log_restart),
    case("fc0c/listen-only", "V1.1b3 6.10",
        "entering listen-only mode is event 04; from then on events have bit 5, up to the restart",
        &[Need::Function(8), Need::Function(0x0C)], log_listen_only).interpretation(),
    case("fc11/shape", "V1.1b3 6.13", "byte count, identification and a run indicator of 00 or FF",
        &[Need::Function(0x11)], server_id),
    case("fc11/length", "V1.1b3 6.13", "a request with data is 03 or silence", &[Need::Function(0x11)],
        |bench| with_data(bench, 0x11)).interpretation(),
];

fn exception_status(bench: &mut Bench<'_>) -> Check {
    let reply = bench.reply(&[7])?;
    bench.ensure(reply.len() == 2, "07 and one byte")
}

/// Sends requests with data that the function does not have. The standard does not define the reply.
fn with_data(bench: &mut Bench<'_>, function: u8) -> Check {
    bench.exception_03_or_silence(&[function, 0])?;
    bench.exception_03_or_silence(&[function, 0, 0])
}

fn events(bench: &mut Bench<'_>) -> Check<u16> {
    let reply = bench.reply(&[0x0B])?;
    let [0x0B, status_high, status_low, high, low] = reply[..] else {
        return bench.fail("0B, two bytes of status, two of count");
    };
    let status = u16::from_be_bytes([status_high, status_low]);
    bench.ensure(status == 0 || status == 0xFFFF, "a status of 0000 or FFFF")?;
    Ok(u16::from_be_bytes([high, low]))
}

fn counter_shape(bench: &mut Bench<'_>) -> Check {
    events(bench).map(drop)
}

fn counter_counts(bench: &mut Bench<'_>) -> Check {
    let before = events(bench)?;
    let again = events(bench)?;
    bench.ensure(again == before, "0B does not count itself")?;
    for _ in 0..3 {
        bench.alive("the first reading of the count")?;
    }
    let after = events(bench)?;
    let wanted = before.wrapping_add(3);
    bench.ensure(after == wanted, format!("three messages done: {wanted}"))?;
    if let Some(function) = super::dispatch::unknown_functions(bench).pop() {
        bench.exception(&[function], 1)?;
        let same = events(bench)?;
        bench.ensure(same == after, "an exception does not count")?;
    }
    let other = bench.other();
    let ping = bench.target.ping.clone();
    bench.ask_unit(other, &ping)?;
    let same = events(bench)?;
    bench.ensure(same == after, "another unit's message does not count")
}

/// Reads the event log: event count, message count and events.
fn log(bench: &mut Bench<'_>) -> Check<(u16, u16, Vec<u8>)> {
    let reply = bench.reply(&[0x0C])?;
    let [0x0C, count, s1, s0, e1, e0, m1, m0, ref events @ ..] = reply[..] else {
        return bench.fail("0C, byte count, status, event count, message count");
    };
    bench.ensure(
        usize::from(count) == events.len() + 6 && events.len() <= 64,
        "a byte count of 6 and the events, at most 64",
    )?;
    let status = u16::from_be_bytes([s1, s0]);
    bench.ensure(status == 0 || status == 0xFFFF, "a status of 0000 or FFFF")?;
    let [count, messages] = [[e1, e0], [m1, m0]].map(u16::from_be_bytes);
    Ok((count, messages, events.to_vec()))
}

fn log_shape(bench: &mut Bench<'_>) -> Check {
    log(bench)?;
    // Cause more events than the log can hold.
    for _ in 0..40 {
        bench.alive("the first reading of the count")?;
    }
    let (_, _, events) = log(bench)?;
    bench.ensure(events.len() == 64, "a full log of 64 events")
}

fn log_counts(bench: &mut Bench<'_>) -> Check {
    let count = events(bench)?;
    let (logged, messages, _) = log(bench)?;
    bench.ensure(logged == count, format!("the event count of 0B, {count}"))?;
    bench.alive("the first reading of the count")?;
    let (logged, later, _) = log(bench)?;
    // 6.9 does not define whether 0C counts itself after its reply.
    let more = logged.wrapping_sub(count);
    let wanted = "one message more is done, or two with the first 0C";
    bench.ensure(more == 1 || more == 2, wanted)?;
    let wanted = "two messages more, this one included, have come";
    bench.ensure(later == messages.wrapping_add(2), wanted)
}

fn log_order(bench: &mut Bench<'_>) -> Check {
    bench.alive("the first reading of the count")?;
    let (_, _, events) = log(bench)?;
    // Receive events have bit 7 set. Send events have bit 7 clear and bit 6 set. The log may already contain the
    // request that reads it.
    let receive = |event: &u8| event & 0x80 != 0;
    let sent = |event: &u8| event & 0xC0 == 0x40;
    let skip = usize::from(events.first().is_some_and(receive));
    let right = events.get(skip).is_some_and(sent) && events.get(skip + 1).is_some_and(receive);
    let wanted = "the last reply sent (40-7F), and before it its request received (80-FF)";
    bench.ensure(right, wanted)?;
    if let Some(function) = super::dispatch::unknown_functions(bench).pop() {
        bench.exception(&[function], 1)?;
        let (_, _, events) = log(bench)?;
        let skip = usize::from(events.first().is_some_and(receive));
        let exception = events.get(skip).is_some_and(|event| event & 0xC1 == 0x41);
        let wanted = "a reply with exception 01 is 41: read exception sent";
        bench.ensure(exception, wanted)?;
    }
    Ok(())
}

fn log_cleared(bench: &mut Bench<'_>) -> Check {
    for _ in 0..6 {
        bench.alive("the first reading of the count")?;
    }
    let (_, _, before) = log(bench)?;
    bench.ensure(before.len() > 6, "a log of the messages before")?;
    bench.reply_unless_lacking(&diagnose(1, &[0xFF, 0]), "08/01")?;
    let (_, _, events) = log(bench)?;
    let wanted = "no event from before the restart with FF00";
    bench.ensure(events.len() <= 4, wanted)?;
    bench.ensure(events.contains(&0), "event 00, the restart")
}

/// Calls `done` and checks the events that the log has for it, the newest first. Several sequences are right where the
/// standard does not define the order of two events.
fn logs(
    bench: &mut Bench<'_>,
    what: &str,
    right: &[&[u8]],
    done: impl FnOnce(&mut Bench<'_>) -> Check,
) -> Check {
    log(bench)?;
    done(bench)?;
    let (_, _, events) = log(bench)?;
    // The request that reads the log may already be in the log.
    let events = events.strip_prefix(&[0x80]).unwrap_or(&events);
    let found = right.iter().any(|right| {
        // The older events must be the events of the first reading.
        let all = [right, &[0x40, 0x80][..]].concat();
        events.starts_with(&all)
    });
    let shown = right.iter().map(|right| hex(right)).collect::<Vec<_>>();
    bench.ensure(
        found,
        format!(
            "for {what} the events {}, the newest first, and before them 40 80 for the reading of the log",
            shown.join(" or ")
        ),
    )
}

fn log_reply(bench: &mut Bench<'_>) -> Check {
    let right = [0x40, 0x80, 0x40, 0x80];
    logs(bench, "two requests", &[&right], |bench| {
        bench.alive("a reading of the log")?;
        bench.alive("a request")
    })
}

fn log_exceptions(bench: &mut Bench<'_>) -> Check {
    let function = super::dispatch::unknown_function(bench)?;
    logs(bench, "exception 01", &[&[0x41, 0x80]], |bench| {
        bench.exception(&[function], 1)
    })?;
    let Some(reading) = (1..=4).find(|function| bench.target.has(*function)) else {
        return Ok(());
    };
    logs(bench, "exception 03", &[&[0x41, 0x80]], |bench| {
        bench.exception(&pdu(reading, 0, 0), 3)
    })?;
    let Some(nowhere) = bench.target.nowhere(reading) else {
        return Ok(());
    };
    logs(bench, "exception 02", &[&[0x41, 0x80]], |bench| {
        bench.exception(&pdu(reading, nowhere, 1), 2)
    })
}

fn log_busy(bench: &mut Bench<'_>) -> Check {
    let format = bench.read_word(FORMAT)?;
    logs(bench, "exception 06", &[&[0x44, 0x80]], |bench| {
        bench.exception(&pdu(6, FORMAT, format), 6)
    })
}

fn log_broadcast(bench: &mut Bench<'_>) -> Check {
    // A broadcast read has no effect on any unit, and no reply.
    logs(bench, "a broadcast", &[&[0x40, 0xC0]], |bench| {
        bench.silent_ping(0, "a broadcast")
    })
}

fn log_bad_check(bench: &mut Bench<'_>) -> Check {
    let frame = line_counters::bad(bench);
    let what = "two frames with a bad check";
    logs(bench, what, &[&[0x82, 0x82]], |bench| {
        bench.silence_to(&frame, "the check is wrong")?;
        bench.silence_to(&frame, "the check is wrong")
    })
}

fn log_bad_character(bench: &mut Bench<'_>) -> Check {
    let frame = bench.ping();
    let pieces = damaged_at(&frame, 2, Piece::BadStop);
    logs(bench, "a damaged character", &[&[0x82]], |bench| {
        bench.silence(&pieces, "a stop bit is low")
    })
}

fn log_others(bench: &mut Bench<'_>) -> Check {
    logs(bench, "requests for another unit", &[&[]], |bench| {
        bench.silent_ping(bench.other(), "the request is for another unit")?;
        bench.silent_ping(bench.other(), "the request is for another unit")
    })
}

fn log_restart(bench: &mut Bench<'_>) -> Check {
    let request = diagnose(1, &[0, 0]);
    bench.reply_unless_lacking(&request, "08/01")?;
    // The unit may restart before or after it has sent the reply.
    let right: [&[u8]; 2] = [&[0x00, 0x40, 0x80], &[0x40, 0x00, 0x80]];
    logs(bench, "a restart with 0000", &right, |bench| {
        bench.reply_is(&request, &request)
    })
}

fn log_listen_only(bench: &mut Bench<'_>) -> Check {
    diagnostics::needs_listen_only(bench)?;
    let ping = bench.target.ping.clone();
    let why = "in listen-only mode nothing is answered";
    let frames = [
        (bench.ping(), why),
        (bench.target.mode.frame(0, &ping), "a broadcast"),
        (line_counters::bad(bench), "the check is wrong"),
    ];
    let mut right = Vec::new();
    // The unit may enter and leave the mode before or after it finishes the request to do so.
    for restart in [&[0x00, 0x60, 0xA0][..], &[0x40, 0x00, 0xA0]] {
        for entry in [&[0x04, 0x40, 0x80][..], &[0x60, 0x04, 0x80]] {
            let frames = [0xA2, 0x60, 0xE0, 0x60, 0xA0];
            right.push([restart, &frames, entry].concat());
        }
    }
    let right: Vec<&[u8]> = right.iter().map(Vec::as_slice).collect();
    let what = "08/04, a request, a broadcast, a bad check and 08/01, all in listen-only mode";
    logs(bench, what, &right, |bench| {
        diagnostics::enter(bench)?;
        let mut silent = Ok(());
        for (frame, why) in frames {
            silent = silent.and_then(|()| bench.silence_to(&frame, why));
        }
        let leave = bench.frame(&diagnose(1, &[0, 0]));
        let left = bench.silence_to(&leave, "08/01 in listen-only mode is obeyed without reply");
        silent.and(left)
    })
}

fn server_id(bench: &mut Bench<'_>) -> Check {
    let reply = bench.reply(&[0x11])?;
    let [0x11, count, ref data @ ..] = reply[..] else {
        return bench.fail("11 and a byte count");
    };
    bench.ensure(
        usize::from(count) == data.len() && data.len() >= 2,
        "a byte count of all that follows, at least id and run indicator",
    )?;
    // The length of the identification differs between devices.
    let indicator = data[1..].iter().any(|byte| matches!(byte, 0 | 0xFF));
    bench.ensure(indicator, "a run indicator of 00 or FF after the id")
}
