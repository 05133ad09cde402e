//! Analog inputs on the converter: voltages in units, a channel with a signal fault, the low-pass and the source's
//! resistance. Every code in every RANGE and SCALE is tested on the host, in `modio-drivers`.

use register_map::configuration::{FILTER, RANGE, SCALE};
use sim::{Module, Time};

use crate::bench::{Bench, SLOT, corner};

const STATUS: u16 = 0x0240 + SLOT;

const VOLTS: u16 = 0;
const CURRENT: u16 = 1;
const NTC: u16 = 2;

const GOOD: u16 = 0;
const OPEN: u16 = 3;

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
    for n in [0, 4, 8] {
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
