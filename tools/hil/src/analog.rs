//! Tests the analog wires of a bench. Each output in turn is set to five values over its range. Its input must be
//! within the tolerance of each value after the time given, and no other input may change. All outputs are restored.

use std::sync::atomic::{AtomicBool, Ordering};

use register_map::codes::{Scale, Signal};
use register_map::points::output_values;
use register_map::{Values, configuration};

use crate::bench_file::{Analog, Place};
use crate::remote::{put_back, read_word, registers, write_word};
use crate::report::Finding;
use crate::verdict;
use conformance::bench::Bench;
use conformance::case::{Check, Failure, Stop};

/// Tests the wires until `stop` is set. Calls `report` with each finding. Fails when the line no longer works, or when
/// an output could not be restored.
pub fn run(
    bench: &mut Bench<'_>,
    wires: &[Analog],
    stop: &AtomicBool,
    mut report: impl FnMut(Finding),
) -> Check {
    let mut before: Vec<(Place, u16)> = Vec::new();
    let tried = try_all(bench, wires, stop, &mut before, &mut report);
    let mut restored = Ok(());
    for (output, value) in before {
        restored = restored.and(put_back(|| write_word(bench, output, value)));
    }
    tried.and(restored)
}

/// A wire, the lowest and the highest value of its output, and the value of its input at the lowest.
struct Known {
    wire: Analog,
    range: Check<(u16, u16)>,
    at_lowest: Option<u16>,
}

fn try_all(
    bench: &mut Bench<'_>,
    wires: &[Analog],
    stop: &AtomicBool,
    before: &mut Vec<(Place, u16)>,
    report: &mut impl FnMut(Finding),
) -> Check {
    let mut known = Vec::new();
    for wire in wires {
        let range = lowest(bench, wire, before);
        if let Err(broken @ Stop::Broken(_)) = range {
            return Err(broken);
        }
        known.push(Known {
            wire: *wire,
            range,
            at_lowest: None,
        });
    }
    let slowest = wires.iter().map(|wire| wire.within).max();
    bench.rest(slowest.unwrap_or_default())?;
    for one in known.iter_mut().filter(|one| one.range.is_ok()) {
        // If an input cannot be read, the test of this wire fails later.
        one.at_lowest = read_word(bench, 4, one.wire.to).ok();
    }
    for Known { wire, range, .. } in &known {
        if stop.load(Ordering::Relaxed) {
            break;
        }
        let begin = bench.endpoint.now();
        let mut worst = 0;
        let followed = range.clone().and_then(|range| {
            let followed = follow(bench, wire, range, &known, &mut worst);
            // Restore the lowest value also after a failure: the tests of the other wires need it.
            followed.and(write_word(bench, wire.from, range.0))
        });
        report(Finding {
            name: format!("analog/{wire}"),
            about: "the input follows the output within the tolerance, and no other input changes"
                .to_owned(),
            note: format!("largest difference {worst}"),
            verdict: verdict(followed)?,
            time: bench.endpoint.now().saturating_sub(begin),
        });
    }
    Ok(())
}

/// Sets the output to its lowest value; returns that value and the highest.
fn lowest(
    bench: &mut Bench<'_>,
    wire: &Analog,
    before: &mut Vec<(Place, u16)>,
) -> Check<(u16, u16)> {
    let (signal, scale) = setting(bench, wire.from)?;
    if (signal, scale) != setting(bench, wire.to)? {
        return Err(Stop::Fail(Failure {
            sent: format!("RANGE and SCALE of {wire}"),
            came: "they differ".to_owned(),
            wanted: "the same signal and scale at both ends".to_owned(),
        }));
    }
    let value = read_word(bench, 3, wire.from)?;
    if !before.iter().any(|(place, _)| *place == wire.from) {
        before.push((wire.from, value));
    }
    let range = Signal::from_code(signal)
        .zip(Scale::from_code(scale))
        .map(|(signal, scale)| output_values(signal, scale));
    let Some(Values::Range { min, max }) = range else {
        return Err(Stop::Fail(Failure {
            sent: format!("RANGE and SCALE of {}", wire.from),
            came: format!("{signal} and {scale}"),
            wanted: "RANGE and SCALE of an analog output".to_owned(),
        }));
    };
    write_word(bench, wire.from, min)?;
    Ok((min, max))
}

/// Reads RANGE and SCALE of a point.
fn setting(bench: &mut Bench<'_>, place: Place) -> Check<(u16, u16)> {
    let mut read = |first| registers(bench, place.unit, first + place.point, 1);
    Ok((
        read(configuration::RANGE)?[0],
        read(configuration::SCALE)?[0],
    ))
}

/// Sets the output to values over its range, and reads the inputs. `worst` is the largest difference within the
/// tolerance.
fn follow(
    bench: &mut Bench<'_>,
    wire: &Analog,
    (min, max): (u16, u16),
    all: &[Known],
    worst: &mut u16,
) -> Check {
    for quarter in [0, 1, 2, 3, 4] {
        let value = min + ((u32::from(max - min) * quarter) / 4) as u16;
        write_word(bench, wire.from, value)?;
        *worst = compare(bench, wire, value)?.max(*worst);
    }
    for other in all.iter().filter(|other| other.wire.from != wire.from) {
        let Some(at_lowest) = other.at_lowest else {
            continue;
        };
        let input = read_word(bench, 4, other.wire.to)?;
        if input.abs_diff(at_lowest) > other.wire.tolerance {
            return Err(Stop::Fail(Failure {
                sent: format!("{} at {max}", wire.from),
                came: format!(
                    "{} changed from {at_lowest} to {input} as well",
                    other.wire.to
                ),
                wanted: format!("{} follows {} only", other.wire.to, other.wire.from),
            }));
        }
    }
    Ok(())
}

/// Waits for the time that the input may need, and compares the input with the output. Returns the
/// difference.
fn compare(bench: &mut Bench<'_>, wire: &Analog, value: u16) -> Check<u16> {
    bench.rest(wire.within)?;
    let input = read_word(bench, 4, wire.to)?;
    let difference = input.abs_diff(value);
    if difference <= wire.tolerance {
        return Ok(difference);
    }
    Err(Stop::Fail(Failure {
        sent: format!("{} at {value}", wire.from),
        came: format!("{} is {input} after {:?}", wire.to, wire.within),
        wanted: format!("{value} +-{}", wire.tolerance),
    }))
}
