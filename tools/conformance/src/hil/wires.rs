//! Tries the wires of a fixture: each output in turn goes on and off, its input must follow in time, and no
//! other input may. All outputs are put back.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::bench::Bench;
use crate::case::{Check, Failure, Stop};
use crate::frame::Reply;
use crate::hil::fixture::{Fixture, Place, Wire};
use crate::hil::report::Finding;
use crate::hil::verdict;
use crate::points::pdu;
use crate::run::Verdict;
use crate::target::Target;

/// How often an output is written before it counts as not put back.
const ATTEMPTS: u32 = 3;

/// Tries all wires, or those before `stop` is set; `tell` hears of each.
///
/// # Errors
///
/// [`Stop::Broken`] when the line is gone, [`Stop::Fail`] when an output could not be put back.
pub fn run(
    bench: &mut Bench<'_>,
    fixture: &Fixture,
    stop: &AtomicBool,
    mut tell: impl FnMut(Finding),
) -> Check {
    let mut before: Vec<(Place, bool)> = Vec::new();
    let tried = try_all(bench, &fixture.wires, stop, &mut before, &mut tell);
    let mut restored = Ok(());
    for (output, on) in before {
        let mut done = write(bench, output, on);
        for _ in 1..ATTEMPTS {
            if done.is_err() {
                done = write(bench, output, on);
            }
        }
        restored = restored.and(done);
    }
    tried.and(restored)
}

fn try_all(
    bench: &mut Bench<'_>,
    wires: &[Wire],
    stop: &AtomicBool,
    before: &mut Vec<(Place, bool)>,
    tell: &mut impl FnMut(Finding),
) -> Check {
    let mut dead: Vec<(Place, Failure)> = Vec::new();
    for Wire { from, .. } in wires {
        if before.iter().any(|(place, _)| place == from) {
            continue;
        }
        match read(bench, 1, *from).and_then(|on| {
            before.push((*from, on));
            write(bench, *from, false)
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
        let begin = bench.endpoint.now();
        let mut note = String::new();
        let verdict = match dead.iter().find(|(place, _)| *place == wire.from) {
            Some((_, failure)) => Verdict::Failed(failure.clone()),
            None => {
                let followed = follow(bench, wire, wires);
                if let Ok([on, off]) = &followed {
                    note = format!(
                        "on after {} ms, off after {} ms",
                        on.as_millis(),
                        off.as_millis()
                    );
                }
                // Off again, whatever it was that failed: the next wire wants it so.
                let off = write(bench, wire.from, false);
                verdict(followed.map(drop).and(off))?
            }
        };
        tell(Finding {
            name: format!("wires/{wire}"),
            about: "the input follows the output, both ways, and no other does".to_owned(),
            note,
            verdict,
            time: bench.endpoint.now().saturating_sub(begin),
        });
    }
    Ok(())
}

/// Switches an output on and off, and watches the inputs; gives how long its own took.
fn follow(bench: &mut Bench<'_>, wire: &Wire, wires: &[Wire]) -> Check<[Duration; 2]> {
    await_level(bench, wire, false)?;
    write(bench, wire.from, true)?;
    let on = await_level(bench, wire, true)?;
    for other in wires.iter().filter(|other| other.from != wire.from) {
        let level = read(bench, 2, other.to)?;
        if level != other.inverted {
            return Err(Stop::Fail(Failure {
                sent: format!("{} on", wire.from),
                came: format!("{} went {} as well", other.to, level_name(level)),
                wanted: format!("{} follows {} alone", other.to, other.from),
            }));
        }
    }
    write(bench, wire.from, false)?;
    let off = await_level(bench, wire, false)?;
    Ok([on, off])
}

/// Waits until the input shows that its output is on, or off.
fn await_level(bench: &mut Bench<'_>, wire: &Wire, on: bool) -> Check<Duration> {
    let wanted = on != wire.inverted;
    let begin = bench.endpoint.now();
    loop {
        let asked = bench.endpoint.now().saturating_sub(begin);
        if read(bench, 2, wire.to)? == wanted {
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

/// Reads a bit by function 01, as an output, or 02, as an input.
fn read(bench: &mut Bench<'_>, function: u8, place: Place) -> Check<bool> {
    let right = |pdu: &[u8]| matches!(pdu, [_, 1, 0 | 1]);
    let reply = ask(bench, place, &pdu(function, place.point, 1), right)?;
    Ok(reply[2] == 1)
}

/// Switches an output by function 05.
fn write(bench: &mut Bench<'_>, place: Place, on: bool) -> Check {
    let request = pdu(5, place.point, if on { 0xFF00 } else { 0 });
    ask(bench, place, &request, |reply| reply == request).map(drop)
}

/// Asks a unit on the line, and wants a reply that is right.
fn ask(
    bench: &mut Bench<'_>,
    place: Place,
    request: &[u8],
    right: impl Fn(&[u8]) -> bool,
) -> Check<Vec<u8>> {
    let target = Target {
        unit: place.unit,
        ..bench.target.clone()
    };
    let mut other = Bench::new(bench.endpoint, &target, bench.patience, false);
    match other.ask(request)? {
        Reply::Pdu(reply) if reply[0] == request[0] && right(&reply) => Ok(reply),
        Reply::Silence => other.fail(format!("an answer from unit {}", place.unit)),
        _ if request[0] == 2 => other.fail(format!("an input at {place}")),
        _ => other.fail(format!("an output at {place}")),
    }
}
