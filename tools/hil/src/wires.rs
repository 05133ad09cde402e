//! Tests the digital wires of a bench. Each output in turn is switched on and off. Its input must follow in time, and
//! no other input may change. If the bench file asks for pulses, the input's counter must count each pulse once. All
//! outputs are restored.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use register_map::counters;

use crate::bench_file::{Place, Wire};
use crate::remote::{put_back, read_bit, registers, write_bit};
use crate::report::Finding;
use crate::verdict;
use conformance::bench::Bench;
use conformance::case::{Check, Failure, Stop};
use conformance::run::Verdict;

/// Tests the wires until `stop` is set. Calls `report` with each finding. Fails when the line no longer works, or when
/// an output could not be restored.
pub fn run(
    bench: &mut Bench<'_>,
    wires: &[Wire],
    stop: &AtomicBool,
    mut report: impl FnMut(Finding),
) -> Check {
    let mut before: Vec<(Place, bool)> = Vec::new();
    let tried = try_all(bench, wires, stop, &mut before, &mut report);
    let mut restored = Ok(());
    for (output, on) in before {
        restored = restored.and(put_back(|| write_bit(bench, output, on)));
    }
    tried.and(restored)
}

fn try_all(
    bench: &mut Bench<'_>,
    wires: &[Wire],
    stop: &AtomicBool,
    before: &mut Vec<(Place, bool)>,
    report: &mut impl FnMut(Finding),
) -> Check {
    let mut dead: Vec<(Place, Failure)> = Vec::new();
    for Wire { from, .. } in wires {
        if before.iter().any(|(place, _)| place == from) {
            continue;
        }
        match read_bit(bench, 1, *from).and_then(|on| {
            before.push((*from, on));
            write_bit(bench, *from, false)
        }) {
            Err(Stop::Fail(failure)) => dead.push((*from, failure)),
            other => other?,
        }
    }
    let slowest = wires.iter().map(|wire| wire.within).max();
    bench.rest(slowest.unwrap_or_default())?;
    for wire in wires {
        if stop.load(Ordering::Relaxed) {
            break;
        }
        let dead = dead.iter().find(|(place, _)| *place == wire.from);
        report(try_one(
            bench,
            wire,
            wires,
            dead.map(|(_, failure)| failure),
        )?);
        if wire.pulses > 0 && dead.is_none() && !stop.load(Ordering::Relaxed) {
            report(count_pulses(bench, wire)?);
        }
    }
    Ok(())
}

fn try_one(
    bench: &mut Bench<'_>,
    wire: &Wire,
    wires: &[Wire],
    dead: Option<&Failure>,
) -> Check<Finding> {
    let begin = bench.endpoint.now();
    let mut note = String::new();
    let verdict = match dead {
        Some(failure) => Verdict::Failed(failure.clone()),
        None => {
            let followed = follow(bench, wire, wires);
            if let Ok([on, off]) = &followed {
                note = format!(
                    "on after {} ms, off after {} ms",
                    on.as_millis(),
                    off.as_millis()
                );
            }
            // Switch the output off also after a failure: the tests of the other wires need it off.
            let off = write_bit(bench, wire.from, false);
            verdict(followed.map(drop).and(off))?
        }
    };
    Ok(Finding {
        name: format!("wires/{wire}"),
        about: "the input follows the output on and off, and no other input changes".to_owned(),
        note,
        verdict,
        time: bench.endpoint.now().saturating_sub(begin),
    })
}

/// Sends pulses to the input, and compares its counter with their number.
fn count_pulses(bench: &mut Bench<'_>, wire: &Wire) -> Check<Finding> {
    let begin = bench.endpoint.now();
    let counted = (|| {
        await_level(bench, wire, false)?;
        let before = counter(bench, wire.to)?;
        for _ in 0..wire.pulses {
            write_bit(bench, wire.from, true)?;
            await_level(bench, wire, true)?;
            write_bit(bench, wire.from, false)?;
            await_level(bench, wire, false)?;
        }
        let counted = counter(bench, wire.to)?.wrapping_sub(before);
        if counted == u32::from(wire.pulses) {
            return Ok(());
        }
        Err(Stop::Fail(Failure {
            sent: format!("{} pulses of {}", wire.pulses, wire.from),
            came: format!("the counter of {} counted {counted}", wire.to),
            wanted: format!("{} pulses counted", wire.pulses),
        }))
    })();
    let off = write_bit(bench, wire.from, false);
    Ok(Finding {
        name: format!("pulses/{wire}"),
        about: "the input's counter counts every pulse once".to_owned(),
        note: format!("{} pulses", wire.pulses),
        verdict: verdict(counted.and(off))?,
        time: bench.endpoint.now().saturating_sub(begin),
    })
}

/// Reads the pulse counter of an input.
fn counter(bench: &mut Bench<'_>, input: Place) -> Check<u32> {
    let first = counters::of_point(input.point);
    let words = registers(bench, input.unit, first, counters::WORDS)?;
    Ok(u32::from(words[0]) << 16 | u32::from(words[1]))
}

/// Switches an output on and off, and reads the inputs. Returns the times in which its own input followed.
fn follow(bench: &mut Bench<'_>, wire: &Wire, wires: &[Wire]) -> Check<[Duration; 2]> {
    await_level(bench, wire, false)?;
    write_bit(bench, wire.from, true)?;
    let on = await_level(bench, wire, true)?;
    for other in wires.iter().filter(|other| other.from != wire.from) {
        let level = read_bit(bench, 2, other.to)?;
        if level != other.inverted {
            return Err(Stop::Fail(Failure {
                sent: format!("{} on", wire.from),
                came: format!("{} changed to {} as well", other.to, level_name(level)),
                wanted: format!("{} follows {} only", other.to, other.from),
            }));
        }
    }
    write_bit(bench, wire.from, false)?;
    let off = await_level(bench, wire, false)?;
    Ok([on, off])
}

/// Waits until the input shows that its output is on, or off.
fn await_level(bench: &mut Bench<'_>, wire: &Wire, on: bool) -> Check<Duration> {
    let wanted = on != wire.inverted;
    let begin = bench.endpoint.now();
    loop {
        let asked = bench.endpoint.now().saturating_sub(begin);
        if read_bit(bench, 2, wire.to)? == wanted {
            return Ok(bench.endpoint.now().saturating_sub(begin));
        }
        if asked >= wire.within {
            return Err(Stop::Fail(Failure {
                sent: format!("{} {}", wire.from, level_name(on)),
                came: format!("{} stays {}", wire.to, level_name(!wanted)),
                wanted: format!("{} within {:?}", level_name(wanted), wire.within),
            }));
        }
    }
}

const fn level_name(on: bool) -> &'static str {
    if on { "on" } else { "off" }
}
