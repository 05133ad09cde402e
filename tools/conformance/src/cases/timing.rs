//! The time of a reply, and the unit's driver.

use std::time::Duration;

use crate::case::{Case, Check, Need, case};
use crate::endpoint::Piece;
use crate::frame::Reply;
use crate::tester::Tester;

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("timing/reply-after-t3.5", "V1.02 2.5.1.1", "a reply starts t3.5 after its request or later",
        &[Need::Rtu, Need::Exact], after_t35),
    case("timing/exceptions-after-t3.5", "V1.02 2.5.1.1", "so do exceptions, and replies to the longest requests",
        &[Need::Rtu, Need::Exact], exceptions_after_t35),
    case("timing/no-gap-in-the-reply", "V1.02 2.5.1.1", "between a reply's characters there is less than t1.5",
        &[Need::Rtu, Need::Exact, Need::CharacterTime], no_gap),
    case("timing/driver-held", "V1.02 3.3",
        "the driver is on before the first start bit and up to the end of the last stop bit",
        &[Need::Exact, Need::Driver], driver),
    case("timing/driver-stays-off", "V1.02 3.3", "what gets silence does not touch the driver",
        &[Need::Exact, Need::Driver], driver_off).interpretation(),
    case("timing/back-to-back", "V1.02 2.5.1.1",
        "a hundred requests, each t3.5 after the reply before it, are all answered", &[Need::Rtu, Need::Exact],
        back_to_back),
];

/// Returns the shortest t3.5 that a unit may use, or the silence that a modio is set to instead.
pub(super) fn silence(tester: &mut Tester<'_>) -> Check<Duration> {
    let line = tester.endpoint.line();
    if tester.target.modio.is_some() {
        let gap = tester.read_word(register_map::configuration::FRAME_GAP)?;
        if gap != 0 {
            // A setting below 1.5 characters counts as these.
            let shortest = line.characters(3) / 2;
            return Ok(shortest.max(Duration::from_micros(100) * u32::from(gap)));
        }
    }
    Ok(line.t35_limits().least)
}

/// Allowance for times that were rounded to nanoseconds.
const ROUNDING: Duration = Duration::from_nanos(10);

fn not_before(tester: &Tester<'_>, least: Duration) -> Check {
    let took = tester.turnaround();
    let wanted = format!("a reply {least:?} after the request or later, not {took:?}");
    tester.ensure(took + ROUNDING >= least, wanted)
}

fn after_t35(tester: &mut Tester<'_>) -> Check {
    let least = silence(tester)?;
    let ping = tester.target.ping.clone();
    for n in 0..20 {
        tester.reply(&ping)?;
        not_before(tester, least)?;
        // Change the phase between the requests and the unit's periodic work.
        tester.rest(Duration::from_micros(137 * n))?;
    }
    Ok(())
}

fn exceptions_after_t35(tester: &mut Tester<'_>) -> Check {
    let least = silence(tester)?;
    let Some(function) = super::dispatch::unknown_functions(tester).pop() else {
        return Ok(());
    };
    for length in [0, 1, 10, 252] {
        tester.exception(&[vec![function], vec![0x33; length]].concat(), 1)?;
        not_before(tester, least)?;
    }
    Ok(())
}

fn no_gap(tester: &mut Tester<'_>) -> Check {
    let t15 = tester.endpoint.line().t15_limits().least;
    for function in 1..=4 {
        let span = tester.target.longest(function);
        let Some(span) = span.filter(|_| tester.target.has(function)) else {
            continue;
        };
        let most = if function <= 2 { 2000 } else { 125 };
        let request = crate::points::pdu(function, span.first, span.len().min(most) as u16);
        tester.reply(&request)?;
        let gaps = tester
            .received
            .windows(2)
            .map(|two| two[1].start.saturating_sub(two[0].end));
        let longest = gaps.max().unwrap_or_default();
        let wanted = format!("gaps below t1.5, {t15:?}, in the reply, not {longest:?}");
        tester.ensure(longest < t15, wanted)?;
    }
    Ok(())
}

fn driver(tester: &mut Tester<'_>) -> Check {
    let ping = tester.target.ping.clone();
    let line = tester.endpoint.line();
    tester.endpoint.take_driver_edges()?;
    for _ in 0..10 {
        tester.reply(&ping)?;
        let edges = tester.endpoint.take_driver_edges()?;
        let [(on, true), (off, false)] = edges[..] else {
            return tester.fail(format!(
                "the driver goes on once and off once, not {edges:?}"
            ));
        };
        let (Some(first), Some(last)) = (tester.received.first(), tester.received.last()) else {
            return tester.fail("a reply");
        };
        let wanted = "the driver on before the first start bit";
        tester.ensure(on <= first.start + ROUNDING, wanted)?;
        tester.ensure(
            off + ROUNDING >= last.end,
            format!(
                "the driver on to the end of the last stop bit, {:?}, not {off:?}",
                last.end
            ),
        )?;
        // The next request may follow t3.5 after the reply.
        let wanted = "the driver off well before the next request may come";
        tester.ensure(off <= last.end + line.t15_limits().most, wanted)?;
        let wanted = "the first start bit soon after the driver is on";
        tester.ensure(first.start <= on + line.t35_limits().most, wanted)?;
    }
    Ok(())
}

fn driver_off(tester: &mut Tester<'_>) -> Check {
    tester.endpoint.take_driver_edges()?;
    let (other, ping) = (tester.other(), tester.target.ping.clone());
    let mode = tester.target.mode;
    for frame in [
        mode.frame(other, &ping),
        mode.frame(0, &ping),
        vec![0x55; 5],
    ] {
        tester.silence_to(&frame, "the frame is not for this unit")?;
    }
    let edges = tester.endpoint.take_driver_edges()?;
    tester.ensure(edges.is_empty(), format!("the driver stays off: {edges:?}"))
}

fn back_to_back(tester: &mut Tester<'_>) -> Check {
    let t35 = tester.endpoint.line().t35_limits().most;
    hundred_requests(tester, |tester| {
        let end = tester
            .received
            .last()
            .map_or(Duration::ZERO, |received| received.end);
        (end + t35).saturating_sub(tester.endpoint.now())
    })
}

/// Sends a hundred requests, each as soon as the reply before it has been received and the gap after it has passed.
pub(super) fn hundred_requests(
    tester: &mut Tester<'_>,
    gap: impl Fn(&Tester<'_>) -> Duration,
) -> Check {
    let ping = tester.ping();
    let reply = tester.raw(&ping)?;
    tester.ensure(tester.is_pong(&reply), "a reply")?;
    let length = tester.received.len();
    for n in 0..100 {
        let pieces = [Piece::Gap(gap(tester)), Piece::Bytes(ping.clone())];
        let reply = tester.exchange_until(&pieces, length)?;
        tester.ensure(tester.is_pong(&reply), format!("a reply to request {n}"))?;
    }
    let late = tester.listen_until(usize::MAX)?;
    tester.ensure(late == Reply::Silence, "silence after the last reply")
}
