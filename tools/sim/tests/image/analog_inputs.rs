//! Analog inputs in every RANGE and SCALE: values against floating point, and the status of each signal fault.

use register_map::configuration::{BETA, FILTER, RANGE, SCALE};
use sim::{Module, Time};

use crate::bench::{Bench, PORT, SLOT, corner};

const STATUS: u16 = 0x0240 + SLOT;
const MODULE_STATE: u16 = 0x0217 + PORT;
const MODULE_FAULT: u16 = 4;

const VOLTS: u16 = 0;
const CURRENT: u16 = 1;
const NTC: u16 = 2;

const GOOD: u16 = 0;
const UNDER: u16 = 1;
const OVER: u16 = 2;
const OPEN: u16 = 3;
const SHORT: u16 = 4;

/// A 4AI module whose channels follow their pins without delay.
fn bench() -> Bench {
    let filters: Vec<_> = (0..4).map(|n| (FILTER + SLOT + n, 0)).collect();
    Bench::set_up(Module::Ai4, &filters)
}

/// Applies the same voltage to all four pins and runs for a few scans.
fn apply(bench: &mut Bench, millivolts: u16) {
    for channel in 1..=4 {
        bench.board.set_millivolts(channel, millivolts).unwrap();
    }
    bench.board.run_for(Time::from_ms(5));
}

fn set(bench: &mut Bench, first: u16, value: u16) {
    bench.configure(first + SLOT, &[value; 4]);
    bench.board.run_for(Time::from_ms(5));
}

/// Degrees Celsius of a 10 k thermistor under a 10 k pull-up, by the formula of its B constant.
fn celsius(millivolts: f64, beta: f64) -> f64 {
    let ratio = millivolts / (3300.0 - millivolts);
    1.0 / (1.0 / 298.15 + ratio.ln() / beta) - 273.15
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn volts_and_milliamps_are_read_raw_and_in_units_on_every_channel() {
    let mut bench = bench();
    for (range, full_scale) in [(VOLTS, 10_000.0), (CURRENT, 20_000.0)] {
        set(&mut bench, RANGE, range);
        for millivolts in [0, 1, 33, 660, 1000, 1650, 2500, 3299, 3300] {
            apply(&mut bench, millivolts);
            for (scale, top) in [(0, 4095.0), (1, full_scale)] {
                set(&mut bench, SCALE, scale);
                let exact = f64::from(millivolts) / 3300.0 * top;
                // The error of counting the converter's 4096 steps as 4095, its rounding, and the rounding to units.
                let steps = 1.5 + f64::from(corner().adc_noise());
                let slack = steps * top / 4095.0 + 0.5;
                for function in [3, 4] {
                    for word in bench.words(function, SLOT, 4).unwrap() {
                        let error = (f64::from(word) - exact).abs();
                        assert!(error <= slack, "{millivolts} mV: {word} for {exact}");
                    }
                }
            }
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn temperatures_are_within_a_fifth_of_a_degree_for_any_beta() {
    let mut bench = bench();
    set(&mut bench, RANGE, NTC);
    set(&mut bench, SCALE, 1);
    let mut compared = 0;
    for beta in [2000, 3435, 3950, 5000] {
        set(&mut bench, BETA, beta);
        for millivolts in (300..=3000).step_by(300) {
            let at = |millivolts| celsius(f64::from(millivolts), f64::from(beta));
            let exact = at(millivolts);
            if !(-20.0..=80.0).contains(&exact) {
                continue;
            }
            // The change that half a step of the converter makes here, in addition to the 0.2 degrees.
            let step = (at(millivolts + 1) - exact).abs() / 2.0;
            apply(&mut bench, millivolts);
            for word in bench.registers(SLOT, 4).unwrap() {
                let error = (f64::from(word as i16) / 10.0 - exact).abs();
                assert!(
                    error <= 0.2 + step,
                    "B {beta}, {millivolts} mV: {word} for {exact}"
                );
                compared += 1;
            }
        }
    }
    assert!(compared >= 60, "only {compared} within -20 to 80 degrees");
    // Temperatures below zero are in two's complement.
    set(&mut bench, BETA, 3950);
    apply(&mut bench, 2820);
    let cold = bench.register(SLOT) as i16;
    assert!((-120..=-90).contains(&cold), "{cold}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn each_fault_of_a_signal_has_its_channel_status_in_either_scale() {
    let mut bench = bench();
    let signals = [
        (VOLTS, 0, GOOD),
        (VOLTS, 3290, GOOD),
        (VOLTS, 3300, OVER),
        (CURRENT, 0, OPEN),
        (CURRENT, 120, OPEN),
        (CURRENT, 495, UNDER),
        (CURRENT, 660, GOOD),
        (CURRENT, 3290, GOOD),
        (CURRENT, 3300, OVER),
        (NTC, 0, SHORT),
        (NTC, 50, OVER),
        (NTC, 1650, GOOD),
        (NTC, 3260, UNDER),
        (NTC, 3300, OPEN),
    ];
    for scale in [0, 1] {
        set(&mut bench, SCALE, scale);
        for (range, millivolts, status) in signals {
            set(&mut bench, RANGE, range);
            // Start from a valid signal: the tests of the drivers cover the hysteresis of the thresholds.
            apply(&mut bench, 1650);
            assert_eq!(bench.registers(STATUS, 4), Ok(vec![GOOD; 4]));
            assert_eq!(bench.register(MODULE_STATE), 0);
            assert!(!bench.status(MODULE_FAULT));

            apply(&mut bench, millivolts);
            let what = format!("range {range}, scale {scale}, {millivolts} mV");
            assert_eq!(bench.registers(STATUS, 4), Ok(vec![status; 4]), "{what}");
            let bad = status != GOOD;
            assert_eq!(
                bench.register(MODULE_STATE),
                if bad { 3 } else { 0 },
                "{what}"
            );
            assert_eq!(bench.status(MODULE_FAULT), bad, "{what}");
            // The status reports the fault; the value can still be read.
            assert!(bench.registers(SLOT, 4).is_ok(), "{what}");
        }
    }
    // A temperature outside the thermistor's range is limited to the end of that range.
    set(&mut bench, RANGE, NTC);
    for (millivolts, tenths) in [(0, 1250), (50, 1250), (3260, -400), (3300, -400_i16)] {
        apply(&mut bench, millivolts);
        assert_eq!(bench.register(SLOT) as i16, tenths, "{millivolts} mV");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn fault_of_a_channel_changes_only_the_status_of_that_channel() {
    let mut bench = bench();
    bench.configure(RANGE + SLOT, &[VOLTS, CURRENT, NTC, CURRENT]);
    bench.configure(SCALE + SLOT, &[1, 1, 1, 0]);
    for (channel, millivolts) in [(1, 1650), (2, 0), (3, 1650), (4, 660)] {
        bench.board.set_millivolts(channel, millivolts).unwrap();
    }
    bench.board.run_for(Time::from_ms(5));
    assert_eq!(bench.registers(STATUS, 4), Ok(vec![GOOD, OPEN, GOOD, GOOD]));
    let words = bench.registers(SLOT, 4).unwrap();
    for (word, (expected, slack)) in words.iter().zip([(5000, 2), (0, 0), (250, 1), (819, 1)]) {
        // One LSB of noise is up to 5 units.
        let slack = slack + 5 * corner().adc_noise();
        assert!(word.abs_diff(expected) <= slack, "{words:?}");
    }
    // Points that do not exist have no status.
    assert_eq!(bench.registers(0x0240, 16), Ok(vec![0; 16]));
    assert_eq!(bench.registers(0x0254, 12), Ok(vec![0; 12]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn filter_n_is_a_low_pass_over_two_to_the_n_samples() {
    let mut bench = bench();
    for n in [0, 1, 2, 4, 6, 8] {
        set(&mut bench, FILTER, n);
        apply(&mut bench, 0);
        bench.board.run_for(Time::from_ms(12 << n));
        let noise = corner().adc_noise();
        assert!(bench.register(SLOT) <= noise);
        let slack = 1.0 + f64::from(noise);
        // A step, and the remaining difference after about 100 samples at 1 kHz.
        for channel in 1..=4 {
            bench.board.set_millivolts(channel, 3300).unwrap();
        }
        let from = bench.board.now();
        for _ in 0..3 {
            let word = bench.register(SLOT);
            // The unit reads the value when the request and t3.5 are over.
            let samples = (bench.sent + bench.t35() - from).as_us() as f64 / 1000.0;
            let code = |samples: f64| {
                let left = (1.0 - 1.0 / f64::from(1 << n)).powf(samples.max(0.0));
                4095.0 * (1.0 - left)
            };
            let (low, high) = (code(samples - 2.0) - slack, code(samples + 1.0) + slack);
            assert!(
                (low..=high).contains(&f64::from(word)),
                "n {n} after {samples}: {word}, not {low} to {high}"
            );
            bench.board.run_for(Time::from_ms(60));
        }
    }
}

/// The unit samples for 55.5 cycles at 12 MHz, which allows sources of up to 50 kOhm (DS5319, RAIN against the
/// sampling time).
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn source_of_50_kohm_reads_correctly_and_source_of_500_kohm_does_not() {
    let mut bench = bench();
    for (channel, millivolts) in [(1, 0), (2, 3300), (3, 0), (4, 3300)] {
        bench.board.set_millivolts(channel, millivolts).unwrap();
        bench.board.set_source_ohms(channel, 50_000).unwrap();
    }
    bench.board.run_for(Time::from_ms(200));
    // The noise of the converter at a corner is 2 LSB.
    let is_right = |word: u16, right: u16| word.abs_diff(right) <= 2;
    let read = bench.registers(SLOT, 4).unwrap();
    assert!(is_right(read[0], 0) && is_right(read[1], 4095), "{read:?}");
    assert!(is_right(read[2], 0) && is_right(read[3], 4095), "{read:?}");
    bench.board.set_source_ohms(3, 500_000).unwrap();
    bench.board.run_for(Time::from_ms(200));
    let read = bench.registers(SLOT, 4).unwrap();
    assert!(is_right(read[0], 0) && is_right(read[1], 4095), "{read:?}");
    assert!(is_right(read[3], 4095), "{read:?}");
    assert!(read[2] > 500, "{}", read[2]);
}
