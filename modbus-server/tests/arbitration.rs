//! Thirty units arbitrate on one line, in virtual time: crystals, interrupts and the cable at their limits.

use modbus_server::line::{Arbitration, Step, Windows};
use rand::rngs::StdRng;
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{RngExt, SeedableRng};

/// The units' clock.
const MHZ: u8 = 72;

/// Returns the cycles in a tick of the units' clocks: 65,536 ticks are about as long as the longest reply.
fn cycles(baud: u32) -> u32 {
    let reply_us = 256 * 11 * 1_000_000 / u64::from(baud) + 1_000;
    (reply_us * u64::from(MHZ)).div_ceil(65_535) as u32
}

/// Returns the times of an arbitration.
fn windows(baud: u32) -> Windows {
    let fractions = |us: f64| (us / fraction_us(baud)) as u32;
    Windows::new(fractions(1e6 / f64::from(baud)), fractions(1.0))
}

/// Returns the length of a fraction of a tick, in us.
fn fraction_us(baud: u32) -> f64 {
    f64::from(cycles(baud)) / f64::from(MHZ) / 65_536.0
}

/// How far units may differ.
#[derive(Clone, Copy)]
struct Limits {
    /// Longest time from a unit's deadline until it acts, in us.
    late_us: f64,
    /// Longest time that an edge is on its way, in us.
    cable_us: f64,
    /// Largest error of a crystal, in ppm.
    ppm: f64,
}

/// The F103 at its slowest, 1,200 m of cable, and crystals of 100 ppm with as much for temperature and age.
const WORST: Limits = Limits {
    late_us: 8.5,
    cable_us: 6.0,
    ppm: 200.0,
};

/// A unit, its place on the line, and its clock.
struct Unit {
    arbitration: Arbitration,
    /// Time from the master to the unit, in us.
    place: f64,
    /// Length of a fraction of its ticks, in us.
    fraction: f64,
    /// Time at which it acts next.
    acts: f64,
    seen: Vec<f64>,
    outcome: Option<Step>,
}

impl Unit {
    /// Converts a time of the unit's clock to a time of the line. The request ended at 0 at the master.
    fn on_line(&self, fractions: u32) -> f64 {
        self.place + f64::from(fractions) * self.fraction
    }

    fn on_clock(&self, us: f64) -> u32 {
        // An edge in front of the end of the request has a time that wraps, as on a device.
        ((us - self.place) / self.fraction) as i64 as u32
    }
}

/// Returns the limit, 0, or a value between them, because the worst is often at the ends.
fn extreme(rng: &mut StdRng, limit: f64) -> f64 {
    *[0.0, limit, rng.random_range(0.0..=limit)]
        .choose(rng)
        .unwrap()
}

/// Lets units with these values arbitrate. Returns the values that won.
fn winners(baud: u32, count: u8, values: &[u32], limits: Limits, rng: &mut StdRng) -> Vec<u32> {
    let times = windows(baud);
    let mut units: Vec<Unit> = values
        .iter()
        .map(|value| {
            let error = extreme(rng, 2.0 * limits.ppm) - limits.ppm;
            Unit {
                arbitration: Arbitration::new(*value, count, 0, times),
                place: extreme(rng, limits.cable_us),
                fraction: fraction_us(baud) * (1.0 + error * 1e-6),
                acts: 0.0,
                seen: Vec::new(),
                outcome: None,
            }
        })
        .collect();
    for unit in &mut units {
        unit.acts = unit.on_line(unit.arbitration.deadline()) + extreme(rng, limits.late_us);
    }
    // The unit that acts next, until all have won or lost.
    while let Some(next) = (0..units.len())
        .filter(|n| units[*n].outcome.is_none())
        .min_by(|a, b| units[*a].acts.total_cmp(&units[*b].acts))
    {
        let unit = &mut units[next];
        let (now, place) = (unit.acts, unit.place);
        let last = unit.seen.iter().copied().filter(|at| *at <= now);
        if let Some(at) = last.max_by(f64::total_cmp) {
            let at = unit.on_clock(at);
            unit.arbitration.fell(at);
        }
        match unit.arbitration.step() {
            Step::Send => {
                // A UART may begin a character only at the next tick of its bit clock. The other units see two falling
                // edges: that of the start bit, and that of the parity bit of an FF with even parity.
                let bit = 1e6 / f64::from(baud);
                let starts = now + extreme(rng, bit);
                for (n, other) in units.iter_mut().enumerate() {
                    let arrives = starts + (other.place - place).abs();
                    if n != next {
                        other.seen.extend([arrives, arrives + 9.0 * bit]);
                    }
                }
            }
            Step::Wait => {}
            over => units[next].outcome = Some(over),
        }
        let unit = &mut units[next];
        let deadline = unit.on_line(unit.arbitration.deadline());
        assert!(
            unit.outcome.is_some() || deadline > now,
            "the deadline has passed"
        );
        unit.acts = deadline + extreme(rng, limits.late_us);
    }
    let won = values.iter().zip(&units);
    won.filter(|(_, unit)| unit.outcome == Some(Step::Won))
        .map(|(value, _)| *value)
        .collect()
}

const RATES: [u32; 7] = [1_200, 9_600, 19_200, 38_400, 115_200, 230_400, 921_600];

#[test]
fn lowest_of_thirty_values_wins_alone() {
    let rng = &mut StdRng::seed_from_u64(1);
    for baud in RATES {
        for count in [12, 32] {
            for round in 0..300 {
                let many = rng.random_range(2..=30);
                let mut values: Vec<u32> = (0..many)
                    .map(|_| rng.random_range(0..1_u32 << count.min(28)))
                    .collect();
                if round % 3 == 0 {
                    // Neighbours: they differ only in the last windows.
                    let first = values[0] & !7;
                    values = (first..first + 8).collect();
                    values.shuffle(rng);
                    values.truncate(many.min(8));
                }
                values.sort_unstable();
                values.dedup();
                values.shuffle(rng);
                let won = winners(baud, count, &values, WORST, rng);
                let lowest = values.iter().min().copied();
                assert_eq!(won, Vec::from_iter(lowest), "{baud} {count} {values:X?}");
            }
        }
    }
}

#[test]
fn two_values_that_differ_in_the_last_window_have_one_winner() {
    let rng = &mut StdRng::seed_from_u64(2);
    for baud in RATES {
        for count in [12, 32] {
            for _ in 0..200 {
                let even = rng.random_range(0..1 << (count - 1)) << 1;
                let won = winners(baud, count, &[even + 1, even], WORST, rng);
                assert_eq!(won, [even], "{baud} {count}");
            }
        }
    }
}

#[test]
fn without_windows_the_unit_replies_when_the_first_one_would_begin() {
    let times = windows(115_200);
    let mut alone = Arbitration::new(0, 0, 5 << 16, times);
    assert_eq!(alone.deadline(), (5 << 16) + times.start);
    assert_eq!(alone.step(), Step::Won);
}

#[test]
fn times_are_those_of_the_extension() {
    for (baud, start, length, guard) in [
        // 38.5 bits, 13 bits, a quarter of a bit.
        (1_200, 32_083.3, 10_833.3, 208.3),
        (9_600, 4_010.4, 1_354.2, 26.0),
        (19_200, 2_005.2, 677.1, 24.0),
        // 12 bits + 800 us, and windows of 12 bits + 50 us, rounded up to 6, 12 and 47 bits.
        (115_200, 904.2, 156.25, 24.0),
        (230_400, 852.1, 104.2, 24.0),
        (921_600, 813.0, 64.0, 24.0),
    ] {
        let times = windows(baud);
        for (is, should) in [
            (times.start, start),
            (times.length, length),
            (times.guard, guard),
        ] {
            let is = f64::from(is) * fraction_us(baud);
            assert!((is - should).abs() < 0.3, "{baud}: {is} {should}");
        }
    }
}
