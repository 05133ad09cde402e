//! The wires of a bench, from outputs to inputs. First all outputs go to their lowest value. Then each output in turn takes
//! other values: its input must follow, and the inputs of other outputs must not change. At the end all outputs have their
//! old values.

use std::time::Duration;

use register_map::codes::{Scale, Signal};
use register_map::points::output_values;
use register_map::{Values, configuration, counters};

use super::remote::{input, output, registers, restore, set};
use crate::case::{Case, Check, Failure, Need, Part, Stop, parts};
use crate::hil::bench_file::{Carries, Place, Wire};
use crate::tester::Tester;

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    parts("wires/each", "map, points",
        "an input follows the output that is wired to it, on and off, and no other input changes",
        &[Need::Modio, Need::Wires],
        |tester, done| each(tester, Wire::is_digital, on_and_off, done)),
    parts("pulses/each", "map, counters", "an input counts every pulse of the output that is wired to it once",
        &[Need::Modio, Need::Pulses], |tester, done| each(tester, Wire::has_pulses, count, done)),
    parts("analog/each", "map, points",
        "an input follows the output that is wired to it within the tolerance, and no other input changes",
        &[Need::Modio, Need::AnalogWires],
        |tester, done| each(tester, |wire| !wire.is_digital(), over_the_range, done)),
];

/// A wire, the lowest and the highest value of its output, and the value of its input at the lowest.
struct Known {
    wire: Wire,
    range: Check<(u16, u16)>,
    at_lowest: Option<u16>,
}

/// Tests a wire whose output has this lowest and highest value. All outputs are at their lowest.
type Test = fn(&mut Tester<'_>, &Wire, (u16, u16), &[Known], &mut Part) -> Check;

/// Tests these wires, and restores their outputs.
fn each(
    tester: &mut Tester<'_>,
    chosen: fn(&Wire) -> bool,
    test: Test,
    done: &mut dyn FnMut(Part),
) -> Check {
    let wires = tester.target.hil.wires.iter().copied();
    let wires: Vec<Wire> = wires.filter(chosen).collect();
    let mut before = Vec::new();
    let tested = from_lowest(tester, &wires, &mut before, test, done);
    let mut restored = Ok(());
    for (wire, value) in before {
        restored = restored.and(restore(tester, &wire, value));
    }
    restored.and(tested)
}

fn from_lowest(
    tester: &mut Tester<'_>,
    wires: &[Wire],
    before: &mut Vec<(Wire, u16)>,
    test: Test,
    done: &mut dyn FnMut(Part),
) -> Check {
    let mut all = Vec::new();
    for wire in wires {
        let range = lowest(tester, wire, before);
        if let Err(broken @ Stop::Broken(_)) = range {
            return Err(broken);
        }
        all.push(Known {
            wire: *wire,
            range,
            at_lowest: None,
        });
    }
    let slowest = wires.iter().map(|wire| wire.within).max();
    tester.rest(slowest.unwrap_or_default())?;
    for known in all.iter_mut().filter(|known| known.range.is_ok()) {
        // If an input cannot be read, the test of this wire fails later.
        known.at_lowest = input(tester, &known.wire).ok();
    }
    for Known { wire, range, .. } in &all {
        tester.go_on()?;
        done(tester.part(wire.to_string(), |tester, part| {
            let range = range.clone()?;
            let tested = test(tester, wire, range, &all, part);
            // Restore the lowest value also after a failure: the tests of the other wires need it.
            tested.and(set(tester, wire, range.0))
        })?);
    }
    Ok(())
}

/// Sets the output to its lowest value; returns that value and the highest.
fn lowest(
    tester: &mut Tester<'_>,
    wire: &Wire,
    before: &mut Vec<(Wire, u16)>,
) -> Check<(u16, u16)> {
    let range = if wire.is_digital() {
        (0, 1)
    } else {
        range(tester, wire)?
    };
    let value = output(tester, wire)?;
    if !before.iter().any(|(other, _)| other.from == wire.from) {
        before.push((*wire, value));
    }
    set(tester, wire, range.0)?;
    Ok(range)
}

/// Returns the lowest and the highest value of an analog output, by RANGE and SCALE, which must be those of the input.
fn range(tester: &mut Tester<'_>, wire: &Wire) -> Check<(u16, u16)> {
    let mut setting = |place: Place| {
        let mut read = |first| registers(tester, place.unit, first + place.point, 1);
        Check::Ok((
            read(configuration::RANGE)?[0],
            read(configuration::SCALE)?[0],
        ))
    };
    let (signal, scale) = setting(wire.from)?;
    if (signal, scale) != setting(wire.to)? {
        return Err(Stop::Fail(Failure {
            sent: format!("RANGE and SCALE of {wire}"),
            came: "they differ".to_owned(),
            wanted: "the same signal and scale at both ends".to_owned(),
        }));
    }
    let values = Signal::from_code(signal)
        .zip(Scale::from_code(scale))
        .map(|(signal, scale)| output_values(signal, scale));
    match values {
        Some(Values::Range { min, max }) => Ok((min, max)),
        _ => Err(Stop::Fail(Failure {
            sent: format!("RANGE and SCALE of {}", wire.from),
            came: format!("{signal} and {scale}"),
            wanted: "RANGE and SCALE of an analog output".to_owned(),
        })),
    }
}

/// Switches the output on and off. The note has the times in which the input followed.
fn on_and_off(
    tester: &mut Tester<'_>,
    wire: &Wire,
    _: (u16, u16),
    all: &[Known],
    part: &mut Part,
) -> Check {
    await_level(tester, wire, false)?;
    set(tester, wire, 1)?;
    let on = await_level(tester, wire, true)?.as_millis();
    others_keep(tester, wire, "on", all)?;
    set(tester, wire, 0)?;
    let off = await_level(tester, wire, false)?.as_millis();
    part.note = format!("on after {on} ms, off after {off} ms");
    Ok(())
}

/// Waits until the input shows that its output is on, or off.
fn await_level(tester: &mut Tester<'_>, wire: &Wire, on: bool) -> Check<Duration> {
    let inverted = matches!(wire.carries, Carries::Bit { inverted: true, .. });
    let wanted = u16::from(on != inverted);
    let begin = tester.endpoint.now();
    loop {
        let asked = tester.endpoint.now().saturating_sub(begin);
        if input(tester, wire)? == wanted {
            return Ok(tester.endpoint.now().saturating_sub(begin));
        }
        if asked >= wire.within {
            return Err(Stop::Fail(Failure {
                sent: format!("{} {}", wire.from, level(u16::from(on))),
                came: format!("{} stays {}", wire.to, level(1 - wanted)),
                wanted: format!("{} within {:?}", level(wanted), wire.within),
            }));
        }
    }
}

const fn level(bit: u16) -> &'static str {
    if bit == 0 { "off" } else { "on" }
}

/// Checks that the inputs of other outputs are as they were at the lowest values. `value` is that of this wire's output.
fn others_keep(tester: &mut Tester<'_>, wire: &Wire, value: &str, all: &[Known]) -> Check {
    for other in all.iter().filter(|other| other.wire.from != wire.from) {
        let Some(at_lowest) = other.at_lowest else {
            continue;
        };
        let Wire { from, to, .. } = other.wire;
        let now = input(tester, &other.wire)?;
        let change = match other.wire.carries {
            Carries::Bit { .. } if now != at_lowest => format!("to {}", level(now)),
            Carries::Word { tolerance } if now.abs_diff(at_lowest) > tolerance => {
                format!("from {at_lowest} to {now}")
            }
            _ => continue,
        };
        return Err(Stop::Fail(Failure {
            sent: format!("{} {value}", wire.from),
            came: format!("{to} changed {change} as well"),
            wanted: format!("{to} follows {from} only"),
        }));
    }
    Ok(())
}

/// Sends pulses to the input, and compares its counter with their number.
fn count(
    tester: &mut Tester<'_>,
    wire: &Wire,
    _: (u16, u16),
    _: &[Known],
    part: &mut Part,
) -> Check {
    let Carries::Bit { pulses, .. } = wire.carries else {
        return Ok(());
    };
    part.note = format!("{pulses} pulses");
    await_level(tester, wire, false)?;
    let before = counter(tester, wire.to)?;
    for _ in 0..pulses {
        set(tester, wire, 1)?;
        await_level(tester, wire, true)?;
        set(tester, wire, 0)?;
        await_level(tester, wire, false)?;
    }
    let counted = counter(tester, wire.to)?.wrapping_sub(before);
    if counted == u32::from(pulses) {
        return Ok(());
    }
    Err(Stop::Fail(Failure {
        sent: format!("{pulses} pulses of {}", wire.from),
        came: format!("the counter of {} counted {counted}", wire.to),
        wanted: format!("{pulses} pulses counted"),
    }))
}

/// Reads the pulse counter of an input.
fn counter(tester: &mut Tester<'_>, input: Place) -> Check<u32> {
    let first = counters::of_point(input.point);
    let words = registers(tester, input.unit, first, counters::WORDS)?;
    Ok(u32::from(words[0]) << 16 | u32::from(words[1]))
}

/// Sets the output to five values over its range. After the time given the input must be within the tolerance of each.
fn over_the_range(
    tester: &mut Tester<'_>,
    wire: &Wire,
    (min, max): (u16, u16),
    all: &[Known],
    part: &mut Part,
) -> Check {
    let Carries::Word { tolerance } = wire.carries else {
        return Ok(());
    };
    let mut worst = 0;
    for quarter in 0..=4 {
        let value = min + (u32::from(max - min) * quarter / 4) as u16;
        set(tester, wire, value)?;
        tester.rest(wire.within)?;
        let followed = input(tester, wire)?;
        let difference = followed.abs_diff(value);
        if difference > tolerance {
            return Err(Stop::Fail(Failure {
                sent: format!("{} at {value}", wire.from),
                came: format!("{} is {followed} after {:?}", wire.to, wire.within),
                wanted: format!("{value} +-{tolerance}"),
            }));
        }
        worst = difference.max(worst);
        part.note = format!("largest difference {worst}");
    }
    others_keep(tester, wire, &format!("at {max}"), all)
}
