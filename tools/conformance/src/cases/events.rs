//! Exception status, event counter, event log, server identification: 07, 0B, 0C, 11.

use crate::bench::Bench;
use crate::case::{Case, Check, Need, case};
use crate::cases::diagnostics::diagnose;

pub(super) const CASES: &[Case] = &[
    case(
        "fc07/shape",
        "V1.1b3 6.7",
        "the reply is one byte of status; a request with data is 03 or silence",
        &[Need::Function(7)],
        exception_status,
    ),
    case(
        "fc0b/shape",
        "V1.1b3 6.9",
        "the reply is a status of 0000 or FFFF and a count; a request with data is 03 or silence",
        &[Need::Function(0x0B)],
        counter_shape,
    ),
    case(
        "fc0b/counts",
        "V1.1b3 6.9",
        "each message done counts one; exceptions and 0B itself do not count",
        &[Need::Function(0x0B)],
        counter_counts,
    ),
    case(
        "fc0c/shape",
        "V1.1b3 6.10",
        "byte count, status, event count, message count and at most 64 events",
        &[Need::Function(0x0C)],
        log_shape,
    ),
    case(
        "fc0c/counts",
        "V1.1b3 6.10",
        "the log's event count is what 0B gives, the log's own reading not in it",
        &[Need::Function(0x0B), Need::Function(0x0C)],
        log_counts,
    ),
    case(
        "fc0c/newest-first",
        "V1.1b3 6.10",
        "the newest event is first: a request received, before it the reply sent",
        &[Need::Function(0x0C)],
        log_order,
    ),
    case(
        "fc0c/cleared-by-restart",
        "V1.1b3 6.8, 08/01",
        "08/01 with FF00 empties the log; the restart itself is event 00",
        &[Need::Function(8), Need::Function(0x0C)],
        log_cleared,
    ),
    case(
        "fc11/shape",
        "V1.1b3 6.13",
        "byte count, identification and a run indicator of 00 or FF",
        &[Need::Function(0x11)],
        server_id,
    ),
];

fn exception_status(bench: &mut Bench<'_>) -> Check {
    let reply = bench.reply(&[7])?;
    bench.ensure(reply.len() == 2, "07 and one byte")?;
    bench.exception_03_or_silence(&[7, 0])
}

/// The event count.
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
    events(bench)?;
    bench.exception_03_or_silence(&[0x0B, 0])?;
    bench.exception_03_or_silence(&[0x0B, 0, 0])
}

fn counter_counts(bench: &mut Bench<'_>) -> Check {
    let before = events(bench)?;
    let again = events(bench)?;
    bench.ensure(again == before, "0B does not count itself")?;
    for _ in 0..3 {
        bench.alive("nothing")?;
    }
    let after = events(bench)?;
    bench.ensure(
        after == before.wrapping_add(3),
        format!("three messages done: {}", before.wrapping_add(3)),
    )?;
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

/// Event count, message count, events.
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
    let events = events.to_vec();
    Ok((
        u16::from_be_bytes([e1, e0]),
        u16::from_be_bytes([m1, m0]),
        events,
    ))
}

fn log_shape(bench: &mut Bench<'_>) -> Check {
    log(bench)?;
    bench.exception_03_or_silence(&[0x0C, 0])?;
    // More events than the log holds.
    for _ in 0..40 {
        bench.alive("nothing")?;
    }
    let (_, _, events) = log(bench)?;
    bench.ensure(events.len() == 64, "a full log of 64 events")
}

fn log_counts(bench: &mut Bench<'_>) -> Check {
    let count = events(bench)?;
    let (logged, messages, _) = log(bench)?;
    bench.ensure(logged == count, format!("the event count of 0B, {count}"))?;
    bench.alive("nothing")?;
    let (logged, later, _) = log(bench)?;
    // 6.9 does not say whether 0C itself counts once its reply is out.
    let more = logged.wrapping_sub(count);
    bench.ensure(
        more == 1 || more == 2,
        "one message more is done, or two with the first 0C",
    )?;
    bench.ensure(
        later == messages.wrapping_add(2),
        "two messages more, this one included, have come",
    )
}

fn log_order(bench: &mut Bench<'_>) -> Check {
    bench.alive("nothing")?;
    let (_, _, events) = log(bench)?;
    // Receive events have bit 7, send events bits 7 and 6 as 01; the request that reads the log may
    // stand in it already.
    let receive = |event: &u8| event & 0x80 != 0;
    let sent = |event: &u8| event & 0xC0 == 0x40;
    let skip = usize::from(events.first().is_some_and(receive));
    let right = events.get(skip).is_some_and(sent) && events.get(skip + 1).is_some_and(receive);
    bench.ensure(
        right,
        "the last reply sent (40-7F), and before it its request received (80-FF)",
    )?;
    if let Some(function) = super::dispatch::unknown_functions(bench).pop() {
        bench.exception(&[function], 1)?;
        let (_, _, events) = log(bench)?;
        let skip = usize::from(events.first().is_some_and(receive));
        let exception = events.get(skip).is_some_and(|event| event & 0xC1 == 0x41);
        bench.ensure(
            exception,
            "a reply with exception 01 is 41: read exception sent",
        )?;
    }
    Ok(())
}

fn log_cleared(bench: &mut Bench<'_>) -> Check {
    for _ in 0..6 {
        bench.alive("nothing")?;
    }
    let (_, _, before) = log(bench)?;
    bench.ensure(before.len() > 6, "a log of the messages before")?;
    bench.reply_unless_lacking(&diagnose(1, &[0xFF, 0]), "08/01")?;
    let (_, _, events) = log(bench)?;
    bench.ensure(
        events.len() <= 4,
        "no event from before the restart with FF00",
    )?;
    bench.ensure(events.contains(&0), "event 00, the restart")
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
    // How long the identification is each device decides.
    let indicator = data[1..].iter().any(|byte| matches!(byte, 0 | 0xFF));
    bench.ensure(indicator, "a run indicator of 00 or FF after the id")?;
    bench.exception_03_or_silence(&[0x11, 0])
}
