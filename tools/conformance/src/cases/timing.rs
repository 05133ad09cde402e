//! The time of a reply, and the unit's driver.

use std::time::Duration;

use crate::bench::Bench;
use crate::case::{Case, Check, Need, case};
use crate::endpoint::Piece;
use crate::frame::Reply;

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
pub(super) fn silence(bench: &mut Bench<'_>) -> Check<Duration> {
    let line = bench.endpoint.line();
    if bench.target.modio.is_some() {
        let gap = bench.read_word(register_map::configuration::FRAME_GAP)?;
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

fn not_before(bench: &Bench<'_>, least: Duration) -> Check {
    let took = bench.turnaround();
    let wanted = format!("a reply {least:?} after the request or later, not {took:?}");
    bench.ensure(took + ROUNDING >= least, wanted)
}

fn after_t35(bench: &mut Bench<'_>) -> Check {
    let least = silence(bench)?;
    let ping = bench.target.ping.clone();
    for n in 0..20 {
        bench.reply(&ping)?;
        not_before(bench, least)?;
        // Change the phase between the requests and the unit's periodic work.
        bench.rest(Duration::from_micros(137 * n))?;
    }
    Ok(())
}

fn exceptions_after_t35(bench: &mut Bench<'_>) -> Check {
    let least = silence(bench)?;
    let Some(function) = super::dispatch::unknown_functions(bench).pop() else {
        return Ok(());
    };
    for length in [0, 1, 10, 252] {
        bench.exception(&[vec![function], vec![0x33; length]].concat(), 1)?;
        not_before(bench, least)?;
    }
    Ok(())
}

fn no_gap(bench: &mut Bench<'_>) -> Check {
    let t15 = bench.endpoint.line().t15_limits().least;
    for function in 1..=4 {
        let span = bench.target.longest(function);
        let Some(span) = span.filter(|_| bench.target.has(function)) else {
            continue;
        };
        let most = if function <= 2 { 2000 } else { 125 };
        let request = crate::points::pdu(function, span.first, span.len().min(most) as u16);
        bench.reply(&request)?;
        let gaps = bench
            .received
            .windows(2)
            .map(|two| two[1].start.saturating_sub(two[0].end));
        let longest = gaps.max().unwrap_or_default();
        let wanted = format!("gaps below t1.5, {t15:?}, in the reply, not {longest:?}");
        bench.ensure(longest < t15, wanted)?;
    }
    Ok(())
}

fn driver(bench: &mut Bench<'_>) -> Check {
    let ping = bench.target.ping.clone();
    let line = bench.endpoint.line();
    bench.endpoint.take_driver_edges()?;
    for _ in 0..10 {
        bench.reply(&ping)?;
        let edges = bench.endpoint.take_driver_edges()?;
        let [(on, true), (off, false)] = edges[..] else {
            return bench.fail(format!(
                "the driver goes on once and off once, not {edges:?}"
            ));
        };
        let (Some(first), Some(last)) = (bench.received.first(), bench.received.last()) else {
            return bench.fail("a reply");
        };
        let wanted = "the driver on before the first start bit";
        bench.ensure(on <= first.start + ROUNDING, wanted)?;
        bench.ensure(
            off + ROUNDING >= last.end,
            format!(
                "the driver on to the end of the last stop bit, {:?}, not {off:?}",
                last.end
            ),
        )?;
        // The next request may follow t3.5 after the reply.
        let wanted = "the driver off well before the next request may come";
        bench.ensure(off <= last.end + line.t15_limits().most, wanted)?;
        let wanted = "the first start bit soon after the driver is on";
        bench.ensure(first.start <= on + line.t35_limits().most, wanted)?;
    }
    Ok(())
}

fn driver_off(bench: &mut Bench<'_>) -> Check {
    bench.endpoint.take_driver_edges()?;
    let (other, ping) = (bench.other(), bench.target.ping.clone());
    let mode = bench.target.mode;
    for frame in [
        mode.frame(other, &ping),
        mode.frame(0, &ping),
        vec![0x55; 5],
    ] {
        bench.silence_to(&frame, "the frame is not for this unit")?;
    }
    let edges = bench.endpoint.take_driver_edges()?;
    bench.ensure(edges.is_empty(), format!("the driver stays off: {edges:?}"))
}

fn back_to_back(bench: &mut Bench<'_>) -> Check {
    let t35 = bench.endpoint.line().t35_limits().most;
    hundred_requests(bench, |bench| {
        let end = bench
            .received
            .last()
            .map_or(Duration::ZERO, |received| received.end);
        (end + t35).saturating_sub(bench.endpoint.now())
    })
}

/// Sends a hundred requests, each as soon as the reply before it has been received and the gap after it has passed.
pub(super) fn hundred_requests(
    bench: &mut Bench<'_>,
    gap: impl Fn(&Bench<'_>) -> Duration,
) -> Check {
    let ping = bench.ping();
    let reply = bench.raw(&ping)?;
    bench.ensure(bench.is_pong(&reply), "a reply")?;
    let length = bench.received.len();
    for n in 0..100 {
        let pieces = [Piece::Gap(gap(bench)), Piece::Bytes(ping.clone())];
        let reply = bench.exchange_until(&pieces, length)?;
        bench.ensure(bench.is_pong(&reply), format!("a reply to request {n}"))?;
    }
    let late = bench.listen_until(usize::MAX)?;
    bench.ensure(late == Reply::Silence, "silence after the last reply")
}
