//! Exception status, event counter, event log, server identification: 07, 0B, 0C, 11.

use register_map::configuration::FORMAT;

use crate::case::{Case, Check, Need, case};
use crate::cases::diagnostics;
use crate::cases::line_counters;
use crate::endpoint::Piece;
use crate::frame::hex;
use crate::points::{diagnose, pdu};
use crate::tester::{Tester, damaged_at};

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("fc07/shape", "V1.1b3 6.7", "the reply is one byte of status", &[Need::Function(7)], exception_status),
    case("fc07/length", "V1.1b3 6.7", "a request with data is 03 or silence", &[Need::Function(7)],
        |tester| with_data(tester, 7)).interpretation(),
    case("fc0b/shape", "V1.1b3 6.9", "the reply is a status of 0000 or FFFF and a count", &[Need::Function(0x0B)],
        counter_shape),
    case("fc0b/length", "V1.1b3 6.9", "a request with data is 03 or silence", &[Need::Function(0x0B)],
        |tester| with_data(tester, 0x0B)).interpretation(),
    case("fc0b/counts", "V1.1b3 6.9", "each message done counts one; exceptions and 0B itself do not count",
        &[Need::Function(0x0B)], counter_counts),
    case("fc0c/shape", "V1.1b3 6.10", "byte count, status, event count, message count and at most 64 events",
        &[Need::Function(0x0C)], log_shape),
    case("fc0c/length", "V1.1b3 6.10", "a request with data is 03 or silence", &[Need::Function(0x0C)],
        |tester| with_data(tester, 0x0C)).interpretation(),
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
        |tester| with_data(tester, 0x11)).interpretation(),
];

fn exception_status(tester: &mut Tester<'_>) -> Check {
    let reply = tester.reply(&[7])?;
    tester.ensure(reply.len() == 2, "07 and one byte")
}

/// Sends requests with data that the function does not have. The standard does not define the reply.
fn with_data(tester: &mut Tester<'_>, function: u8) -> Check {
    tester.exception_03_or_silence(&[function, 0])?;
    tester.exception_03_or_silence(&[function, 0, 0])
}

fn events(tester: &mut Tester<'_>) -> Check<u16> {
    let reply = tester.reply(&[0x0B])?;
    let [0x0B, status_high, status_low, high, low] = reply[..] else {
        return tester.fail("0B, two bytes of status, two of count");
    };
    let status = u16::from_be_bytes([status_high, status_low]);
    tester.ensure(status == 0 || status == 0xFFFF, "a status of 0000 or FFFF")?;
    Ok(u16::from_be_bytes([high, low]))
}

fn counter_shape(tester: &mut Tester<'_>) -> Check {
    events(tester).map(drop)
}

fn counter_counts(tester: &mut Tester<'_>) -> Check {
    let before = events(tester)?;
    let again = events(tester)?;
    tester.ensure(again == before, "0B does not count itself")?;
    for _ in 0..3 {
        tester.alive("the first reading of the count")?;
    }
    let after = events(tester)?;
    let wanted = before.wrapping_add(3);
    tester.ensure(after == wanted, format!("three messages done: {wanted}"))?;
    if let Some(function) = super::dispatch::unknown_functions(tester).pop() {
        tester.exception(&[function], 1)?;
        let same = events(tester)?;
        tester.ensure(same == after, "an exception does not count")?;
    }
    let other = tester.other();
    let ping = tester.target.ping.clone();
    tester.ask_unit(other, &ping)?;
    let same = events(tester)?;
    tester.ensure(same == after, "another unit's message does not count")
}

/// Reads the event log: event count, message count and events.
fn log(tester: &mut Tester<'_>) -> Check<(u16, u16, Vec<u8>)> {
    let reply = tester.reply(&[0x0C])?;
    let [0x0C, count, s1, s0, e1, e0, m1, m0, ref events @ ..] = reply[..] else {
        return tester.fail("0C, byte count, status, event count, message count");
    };
    tester.ensure(
        usize::from(count) == events.len() + 6 && events.len() <= 64,
        "a byte count of 6 and the events, at most 64",
    )?;
    let status = u16::from_be_bytes([s1, s0]);
    tester.ensure(status == 0 || status == 0xFFFF, "a status of 0000 or FFFF")?;
    let [count, messages] = [[e1, e0], [m1, m0]].map(u16::from_be_bytes);
    Ok((count, messages, events.to_vec()))
}

fn log_shape(tester: &mut Tester<'_>) -> Check {
    log(tester)?;
    // Cause more events than the log can hold.
    for _ in 0..40 {
        tester.alive("the first reading of the count")?;
    }
    let (_, _, events) = log(tester)?;
    tester.ensure(events.len() == 64, "a full log of 64 events")
}

fn log_counts(tester: &mut Tester<'_>) -> Check {
    let count = events(tester)?;
    let (logged, messages, _) = log(tester)?;
    tester.ensure(logged == count, format!("the event count of 0B, {count}"))?;
    tester.alive("the first reading of the count")?;
    let (logged, later, _) = log(tester)?;
    // 6.9 does not define whether 0C counts itself after its reply.
    let more = logged.wrapping_sub(count);
    let wanted = "one message more is done, or two with the first 0C";
    tester.ensure(more == 1 || more == 2, wanted)?;
    let wanted = "two messages more, this one included, have come";
    tester.ensure(later == messages.wrapping_add(2), wanted)
}

fn log_order(tester: &mut Tester<'_>) -> Check {
    tester.alive("the first reading of the count")?;
    let (_, _, events) = log(tester)?;
    // Receive events have bit 7 set. Send events have bit 7 clear and bit 6 set. The log may already contain the
    // request that reads it.
    let receive = |event: &u8| event & 0x80 != 0;
    let sent = |event: &u8| event & 0xC0 == 0x40;
    let skip = usize::from(events.first().is_some_and(receive));
    let right = events.get(skip).is_some_and(sent) && events.get(skip + 1).is_some_and(receive);
    let wanted = "the last reply sent (40-7F), and before it its request received (80-FF)";
    tester.ensure(right, wanted)?;
    if let Some(function) = super::dispatch::unknown_functions(tester).pop() {
        tester.exception(&[function], 1)?;
        let (_, _, events) = log(tester)?;
        let skip = usize::from(events.first().is_some_and(receive));
        let exception = events.get(skip).is_some_and(|event| event & 0xC1 == 0x41);
        let wanted = "a reply with exception 01 is 41: read exception sent";
        tester.ensure(exception, wanted)?;
    }
    Ok(())
}

fn log_cleared(tester: &mut Tester<'_>) -> Check {
    for _ in 0..6 {
        tester.alive("the first reading of the count")?;
    }
    let (_, _, before) = log(tester)?;
    tester.ensure(before.len() > 6, "a log of the messages before")?;
    tester.reply_unless_lacking(&diagnose(1, &[0xFF, 0]), "08/01")?;
    let (_, _, events) = log(tester)?;
    let wanted = "no event from before the restart with FF00";
    tester.ensure(events.len() <= 4, wanted)?;
    tester.ensure(events.contains(&0), "event 00, the restart")
}

/// Calls `done` and checks the events that the log has for it, the newest first. Several sequences are right where the
/// standard does not define the order of two events.
fn logs(
    tester: &mut Tester<'_>,
    what: &str,
    right: &[&[u8]],
    done: impl FnOnce(&mut Tester<'_>) -> Check,
) -> Check {
    log(tester)?;
    done(tester)?;
    let (_, _, events) = log(tester)?;
    // The request that reads the log may already be in the log.
    let events = events.strip_prefix(&[0x80]).unwrap_or(&events);
    let found = right.iter().any(|right| {
        // The older events must be the events of the first reading.
        let all = [right, &[0x40, 0x80][..]].concat();
        events.starts_with(&all)
    });
    let shown = right.iter().map(|right| hex(right)).collect::<Vec<_>>();
    tester.ensure(
        found,
        format!(
            "for {what} the events {}, the newest first, and before them 40 80 for the reading of the log",
            shown.join(" or ")
        ),
    )
}

fn log_reply(tester: &mut Tester<'_>) -> Check {
    let right = [0x40, 0x80, 0x40, 0x80];
    logs(tester, "two requests", &[&right], |tester| {
        tester.alive("a reading of the log")?;
        tester.alive("a request")
    })
}

fn log_exceptions(tester: &mut Tester<'_>) -> Check {
    let function = super::dispatch::unknown_function(tester)?;
    logs(tester, "exception 01", &[&[0x41, 0x80]], |tester| {
        tester.exception(&[function], 1)
    })?;
    let Some(reading) = (1..=4).find(|function| tester.target.has(*function)) else {
        return Ok(());
    };
    logs(tester, "exception 03", &[&[0x41, 0x80]], |tester| {
        tester.exception(&pdu(reading, 0, 0), 3)
    })?;
    let Some(nowhere) = tester.target.nowhere(reading) else {
        return Ok(());
    };
    logs(tester, "exception 02", &[&[0x41, 0x80]], |tester| {
        tester.exception(&pdu(reading, nowhere, 1), 2)
    })
}

fn log_busy(tester: &mut Tester<'_>) -> Check {
    let format = tester.read_word(FORMAT)?;
    logs(tester, "exception 06", &[&[0x44, 0x80]], |tester| {
        tester.exception(&pdu(6, FORMAT, format), 6)
    })
}

fn log_broadcast(tester: &mut Tester<'_>) -> Check {
    // A broadcast read has no effect on any unit, and no reply.
    logs(tester, "a broadcast", &[&[0x40, 0xC0]], |tester| {
        tester.silent_ping(0, "a broadcast")
    })
}

fn log_bad_check(tester: &mut Tester<'_>) -> Check {
    let frame = line_counters::bad(tester);
    let what = "two frames with a bad check";
    logs(tester, what, &[&[0x82, 0x82]], |tester| {
        tester.silence_to(&frame, "the check is wrong")?;
        tester.silence_to(&frame, "the check is wrong")
    })
}

fn log_bad_character(tester: &mut Tester<'_>) -> Check {
    let frame = tester.ping();
    let pieces = damaged_at(&frame, 2, Piece::BadStop);
    logs(tester, "a damaged character", &[&[0x82]], |tester| {
        tester.silence(&pieces, "a stop bit is low")
    })
}

fn log_others(tester: &mut Tester<'_>) -> Check {
    logs(tester, "requests for another unit", &[&[]], |tester| {
        tester.silent_ping(tester.other(), "the request is for another unit")?;
        tester.silent_ping(tester.other(), "the request is for another unit")
    })
}

fn log_restart(tester: &mut Tester<'_>) -> Check {
    let request = diagnose(1, &[0, 0]);
    tester.reply_unless_lacking(&request, "08/01")?;
    // The unit may restart before or after it has sent the reply.
    let right: [&[u8]; 2] = [&[0x00, 0x40, 0x80], &[0x40, 0x00, 0x80]];
    logs(tester, "a restart with 0000", &right, |tester| {
        tester.reply_is(&request, &request)
    })
}

fn log_listen_only(tester: &mut Tester<'_>) -> Check {
    diagnostics::needs_listen_only(tester)?;
    let ping = tester.target.ping.clone();
    let why = "in listen-only mode nothing is answered";
    let frames = [
        (tester.ping(), why),
        (tester.target.mode.frame(0, &ping), "a broadcast"),
        (line_counters::bad(tester), "the check is wrong"),
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
    logs(tester, what, &right, |tester| {
        diagnostics::enter(tester)?;
        let mut silent = Ok(());
        for (frame, why) in frames {
            silent = silent.and_then(|()| tester.silence_to(&frame, why));
        }
        let leave = tester.frame(&diagnose(1, &[0, 0]));
        let left = tester.silence_to(&leave, "08/01 in listen-only mode is obeyed without reply");
        silent.and(left)
    })
}

fn server_id(tester: &mut Tester<'_>) -> Check {
    let reply = tester.reply(&[0x11])?;
    let [0x11, count, ref data @ ..] = reply[..] else {
        return tester.fail("11 and a byte count");
    };
    tester.ensure(
        usize::from(count) == data.len() && data.len() >= 2,
        "a byte count of all that follows, at least id and run indicator",
    )?;
    // The length of the identification differs between devices.
    let indicator = data[1..].iter().any(|byte| matches!(byte, 0 | 0xFF));
    tester.ensure(indicator, "a run indicator of 00 or FF after the id")
}
