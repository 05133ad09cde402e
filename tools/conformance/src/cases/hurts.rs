//! Faults that users of such devices report, as far as they show on the line.

use std::time::Duration;

use fastrand::Rng;
use register_map::{configuration, state};

use crate::case::{Case, Check, Need, case};
use crate::cases::timing::hundred_requests;
use crate::frame::{Mode, Reply, crc, rtu};
use crate::points::{pdu, words_of};
use crate::tester::Tester;

#[rustfmt::skip]
pub(super) const CASES: &[Case] = &[
    case("hurts/odd-frames", "V1.02 2.4.2",
        "random frames, with good checks too, never upset the unit: the next good request is answered", &[],
        odd_frames),
    case("hurts/noise", "V1.02 2.5.1.1", "random bytes never get a reply, and the next good request is answered", &[],
        noise),
    case("hurts/restarts", "map, 0x0208",
        "nothing on the line restarts the unit: its uptime goes on, its reset cause stays", &[Need::Modio], restarts),
    case("hurts/masters-without-gaps", "map, line",
        "a master that asks again a bit or 10 us after a reply, whichever is longer, is answered every time",
        &[Need::Modio, Need::Rtu, Need::Exact], no_gaps),
    case("hurts/wrong-baud-and-format", "map, 0x0101",
        "a rate or format that does not exist is exception 03 and changes nothing", &[Need::Modio, Need::Function(6)],
        wrong_settings),
    case("hurts/half-written", "map, 0x0300",
        "one half of a counter cannot be written: exception 03, and the counter stays",
        &[Need::Modio, Need::Function(0x10)], half_written),
    case("hurts/torn-values", "map, communication watchdog",
        "a read of several outputs while they go to SAFE gives all of them before or all of them after",
        &[Need::Modio, Need::Config, Need::Exact, Need::Function(6)], super::outputs::torn),
];

/// Returns the number of random frames, or bursts of noise: more where the host does not have to wait for them.
fn many(tester: &Tester<'_>) -> usize {
    tester.exact(500, 60)
}

/// Returns a generator of random numbers, which are the same in every run on the same unit and line. Each `use_of`,
/// each module and each rate has its own numbers, so that tests of several units try different frames.
fn generator(tester: &Tester<'_>, use_of: Use) -> Rng {
    let (target, line) = (tester.target, tester.endpoint.line());
    let modio = target.modio.map(|modio| modio.to_string());
    let unit = format!("{} {:?} {modio:?} {line}", target.unit, target.mode);
    let [high, low] = crc(unit.as_bytes());
    Rng::with_seed(u64::from_le_bytes([high, low, use_of as u8, 0, 0, 0, 0, 0]))
}

/// What random numbers are used for.
#[derive(Clone, Copy)]
enum Use {
    OddFrames,
    Noise,
    Restarts,
}

/// Returns a PDU that changes nothing on any device: a good or bad read, or a write that is cut.
fn harmless(rng: &mut Rng, unknown: &[u8]) -> Vec<u8> {
    let function = match rng.u8(0..12) {
        0..6 => rng.u8(1..=4),
        6 => *rng.choice(&[5, 6, 0x0F, 0x10, 0x16, 0x17]).unwrap_or(&5),
        7 => *rng.choice(&[7, 0x0B, 0x0C, 0x11, 0x2B]).unwrap_or(&7),
        8 => 0,
        9 => rng.u8(0x80..=0xFF),
        _ => *rng.choice(unknown).unwrap_or(&0x6F),
    };
    let longest = match function {
        5 | 6 | 0x0F | 0x10 | 0x16 | 0x17 => 3,
        1..=4 => 12,
        // Most frames are short, so that a run has time for more of them.
        _ if rng.u8(0..4) > 0 => 24,
        _ => 252,
    };
    let length = rng.usize(0..=longest);
    let mut pdu = vec![function];
    pdu.extend((0..length).map(|_| rng.u8(..)));
    pdu
}

fn odd_frames(tester: &mut Tester<'_>) -> Check {
    let rng = generator(tester, Use::OddFrames);
    send_odd_frames(tester, rng)
}

fn send_odd_frames(tester: &mut Tester<'_>, mut rng: Rng) -> Check {
    let unknown = super::dispatch::unknown_functions(tester);
    for n in 0..many(tester) {
        let pdu = harmless(&mut rng, &unknown);
        let unit = if rng.u8(0..8) == 0 { 0 } else { tester.unit() };
        let reply = tester.ask_unit(unit, &pdu)?;
        let right = match &reply {
            Reply::Silence => true,
            Reply::Wrong(..) => false,
            Reply::Pdu(answer) => unit != 0 && answer[0] & 0x7F == pdu[0] & 0x7F,
        };
        let wanted = format!("silence, or a reply in good form: frame {n}");
        tester.ensure(right, wanted)?;
        if n % 20 == 19 {
            tester.alive("odd frames")?;
        }
    }
    tester.alive("odd frames")
}

fn noise(tester: &mut Tester<'_>) -> Check {
    let mut rng = generator(tester, Use::Noise);
    for n in 0..many(tester) {
        let length = if rng.u8(0..20) == 0 {
            rng.usize(200..600)
        } else {
            rng.usize(1..24)
        };
        let mut bytes: Vec<u8> = (0..length).map(|_| rng.u8(..)).collect();
        if rng.bool() {
            bytes[0] = tester.unit();
        }
        let split = bytes.len().saturating_sub(2);
        if bytes.len() >= 4 && rtu(&bytes[..split]) == bytes {
            continue;
        }
        tester.silence_to(&bytes, format!("the bytes are noise, burst {n}"))?;
        if n % 20 == 19 {
            tester.alive("noise")?;
        }
    }
    tester.alive("noise")
}

/// Reads the uptime in seconds and the reset cause.
fn age(tester: &mut Tester<'_>) -> Check<(u32, u16)> {
    let reply = tester.reply(&pdu(3, state::RESET_CAUSE, 3))?;
    let [cause, high, low] = words_of(&reply)[..] else {
        return tester.fail("three registers");
    };
    Ok((u32::from(high) << 16 | u32::from(low), cause))
}

fn restarts(tester: &mut Tester<'_>) -> Check {
    let before = age(tester)?;
    let begin = tester.endpoint.now();
    tester.rest(Duration::from_secs(1))?;
    let rng = generator(tester, Use::Restarts);
    send_odd_frames(tester, rng)?;
    let after = age(tester)?;
    let passed = (tester.endpoint.now() - begin).as_secs_f64();
    let counted = f64::from(after.0.saturating_sub(before.0));
    tester.ensure(after.1 == before.1, "the reset cause is unchanged")?;
    // Where time is not exact, the unit may be a simulator that is slower than its clock.
    let most = tester.exact(1.5, f64::INFINITY);
    let right = after.0 >= before.0 && (counted - passed).abs() <= most;
    let wanted = format!("an uptime that has increased by {passed:.1} s");
    tester.ensure(right, wanted)
}

/// Longest time in which a modio turns its driver off and its receiver on after a reply, unless a bit is longer.
const READY: Duration = Duration::from_micros(10);

fn no_gaps(tester: &mut Tester<'_>) -> Check {
    let ready = tester.endpoint.line().bits(1).max(READY);
    hundred_requests(tester, |tester| {
        let last = tester.received.last();
        let end = last.map_or(Duration::ZERO, |received| received.end);
        (end + ready).saturating_sub(tester.endpoint.now())
    })
}

fn wrong_settings(tester: &mut Tester<'_>) -> Check {
    // Formats 4 to 6 have seven data bits, which RTU cannot use.
    let formats: &[u16] = match tester.target.mode {
        Mode::Rtu => &[4, 5, 6, 7, 255, 0xFFFF],
        Mode::Ascii => &[7, 255, 0xFFFF],
    };
    let modes: &[u16] = match tester.endpoint.line().format.data_bits {
        7 => &[0, 2, 0xFFFF],
        _ => &[2, 0xFFFF],
    };
    for (register, values) in [
        (configuration::BAUD, &[0, 1, 95, 97, 9217, 0xFFFF][..]),
        (configuration::FORMAT, formats),
        (configuration::MODE, modes),
    ] {
        let before = tester.read_word(register)?;
        for value in values {
            tester.exception(&pdu(6, register, *value), 3)?;
        }
        tester.word_is(register, before)?;
    }
    Ok(())
}

fn half_written(tester: &mut Tester<'_>) -> Check {
    use register_map::{counters, points};
    let slot = tester.target.modio.and_then(|modio| modio.slots().next());
    let at = counters::of_point(slot.map_or(0, |(port, _)| points::first(port)));
    let before = tester.reply(&pdu(3, at, 2))?;
    for (from, words) in [
        (at, &[0][..]),
        (at + 1, &[0]),
        (at + 1, &[0, 0]),
        (at, &[0, 1]),
        (at, &[0, 0, 0]),
    ] {
        tester.exception(&crate::points::write_words(from, words), 3)?;
    }
    let now = tester.reply(&pdu(3, at, 2))?;
    tester.ensure(now == before, "the counter is unchanged")
}
