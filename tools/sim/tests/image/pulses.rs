//! Pulses of noise on the line, each too short for a start bit (RM0008 27.3.3): they delay a reply by at most one
//! character, and a real character that begins just before t3.5 still belongs to the frame.

use register_map::{codes::Baud, configuration};
use sim::{Module, Time};

use crate::rig::{FIRST, Rig, adu};

/// A read of the four inputs.
const REQUEST: [u8; 6] = [1, 2, 0, FIRST, 0, 4];

/// Number of pulses per second.
const PULSE_RATES: [u32; 6] = [10, 100, 333, 1000, 10_000, 100_000];

fn at(baud: Baud) -> Rig {
    let mut rig = Rig::set_up(Module::Di4, &[(configuration::BAUD, baud.code())]);
    // Wait for the first t3.5 of silence.
    rig.board.run_for(Time::from_ms(40));
    rig
}

/// Returns widths of pulses, from the shortest that TIM1 detects to the longest that is not a start bit, with the line
/// high for at least three quarters of the time.
fn widths(rig: &Rig, period: Time) -> Vec<Time> {
    let bit = rig.bit().as_ns();
    let widths = [100, bit / 20, bit / 4, bit * 9 / 20].map(Time::from_ns);
    let fits = |width: &Time| width.as_ns() <= period.as_ns() / 4;
    widths.into_iter().filter(fits).collect()
}

/// Puts one pulse on the line.
fn pulse(rig: &mut Rig, at: Time, width: Time) {
    rig.board.line().noise(at, width);
}

/// Puts pulses on the line from `from` to `to`.
fn pulses(rig: &mut Rig, from: Time, to: Time, period: Time, width: Time) {
    let mut at = from;
    while at + width < to {
        pulse(rig, at, width);
        at += period;
    }
}

/// Returns the time from the end of the request until the unit enables its driver; `None` when there is no reply. The
/// time is taken from the driver because a pulse just before the reply may hide its first start bit from the listener.
fn turnaround(rig: &mut Rig, end: Time) -> Option<Time> {
    let limit = end + rig.t35() * 3 + rig.characters(20);
    while rig.board.now() < limit {
        let on = rig
            .board
            .line()
            .driver_edges()
            .find(|&(at, on)| on && at > end);
        if let Some((on, _)) = on {
            let rest = rig.characters(12) + rig.t35();
            rig.board.run_for(rest);
            return Some(on - end);
        }
        let step = rig.characters(1);
        rig.board.run_for(step);
    }
    None
}

/// Returns the latest time after the end of a request at which the reply begins when there are no pulses. The receiver
/// may see that end a sixteenth of a bit late.
fn latest(rig: &Rig) -> Time {
    rig.t35() + rig.sixteenth() + Time::from_us(60)
}

fn assert_prompt(rig: &mut Rig, end: Time, what: &str) {
    let most = latest(rig) + rig.characters(1);
    match turnaround(rig, end) {
        Some(time) if time <= most => {}
        other => panic!("{what}: a reply within {most}, not {other:?}"),
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn pulses_after_a_request_delay_its_reply_by_one_character_at_most() {
    for &baud in Baud::ALL {
        let mut rig = at(baud);
        for rate in PULSE_RATES {
            let period = Time::cycles(1, rate);
            for width in widths(&rig, period) {
                let now = rig.board.now();
                let end = rig.board.line().send(now, &adu(&REQUEST));
                let last = end + rig.t35() + rig.characters(1);
                let first = end + rig.bit();
                pulses(&mut rig, first, last, period, width);
                let what = format!("{baud:?}, {rate} pulses a second of {width}");
                assert_prompt(&mut rig, end, &what);
            }
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_single_pulse_at_any_instant_after_a_request_delays_its_reply_by_one_character_at_most() {
    for baud in [Baud::B9600, Baud::B115200] {
        let mut rig = at(baud);
        for sixteenth in 1..=16 {
            let now = rig.board.now();
            let end = rig.board.line().send(now, &adu(&REQUEST));
            let after = Time::from_ns(rig.t35().as_ns() * sixteenth / 16);
            let (at, width) = (end + after, Time::from_us(1).min(rig.bit()));
            pulse(&mut rig, at, width);
            assert_prompt(
                &mut rig,
                end,
                &format!("{baud:?}, a pulse {after} after the request"),
            );
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn pulses_before_a_request_do_not_delay_its_reply() {
    for baud in [
        Baud::B1200,
        Baud::B9600,
        Baud::B19200,
        Baud::B115200,
        Baud::B921600,
    ] {
        let mut rig = at(baud);
        for rate in PULSE_RATES {
            let period = Time::cycles(1, rate);
            for width in widths(&rig, period) {
                let begin = rig.board.now();
                // The receiver samples a pulse for most of a bit before it rejects the pulse as noise.
                let start = begin + Time::from_ms(20);
                let last = start - rig.bit();
                pulses(&mut rig, begin, last, period, width);
                let end = rig.board.line().send(start, &adu(&REQUEST));
                let most = latest(&rig);
                let time = turnaround(&mut rig, end);
                assert!(
                    time.is_some_and(|time| time <= most),
                    "{baud:?}, {rate} pulses a second of {width} before the request: {time:?}"
                );
            }
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn pulses_between_the_characters_of_a_request_do_not_damage_it() {
    for baud in [Baud::B1200, Baud::B9600, Baud::B19200] {
        let mut rig = at(baud);
        let now = rig.board.now();
        let mut end = now;
        // A silence of one character follows each character, with a pulse in it.
        for byte in adu(&REQUEST) {
            end = rig.board.line().send(end, &[byte]);
            let pause = rig.characters(1);
            let (at, width) = (end + rig.bit(), Time::from_us(5));
            pulse(&mut rig, at, width);
            end += pause;
        }
        let end = end - rig.characters(1);
        assert_prompt(&mut rig, end, &format!("{baud:?}, a pulse in each gap"));
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_pulse_in_every_bit_of_a_request_does_not_damage_it() {
    for &baud in Baud::ALL {
        let mut rig = at(baud);
        let now = rig.board.now();
        let end = rig.board.line().send(now, &adu(&REQUEST));
        // One of the three samples in the middle of each bit is wrong: the majority decides (RM0008 27.3.3).
        let (bit, width) = (rig.bit(), Time::from_ns(rig.bit().as_ns() / 20));
        let mut middle = now + Time::from_ns(bit.as_ns() / 2);
        while middle < end {
            pulse(&mut rig, middle, width);
            middle += bit;
        }
        assert_prompt(&mut rig, end, &format!("{baud:?}, a pulse in every bit"));
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_character_that_begins_just_before_t35_belongs_to_the_frame_with_pulses_too() {
    for baud in [Baud::B9600, Baud::B19200, Baud::B115200] {
        for noisy in [false, true] {
            let mut rig = at(baud);
            let frame = adu(&REQUEST);
            let (first, rest) = frame.split_at(5);
            let now = rig.board.now();
            let pause = rig.board.line().send(now, first);
            // The receiver needs two bits to detect the end of the last character.
            let gap = rig.t35() - rig.bit() * 2;
            if noisy {
                let (at, width) = (pause + rig.bit(), Time::from_us(1).min(rig.bit()));
                pulse(&mut rig, at, width);
            }
            let end = rig.board.line().send(pause + gap, rest);
            let what = format!("{baud:?}, a gap of {gap}, noise: {noisy}");
            assert_prompt(&mut rig, end, &what);
        }
    }
}
