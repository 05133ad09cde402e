//! A bus in virtual time: one master, and units with different clocks at different places.

use modbus_server::line::{Turn, Windows};
use rand::rngs::StdRng;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};

use crate::unit::{Times, Unit};

/// Longest time from a unit's turn until it acts, in us: interrupts at the slow corner.
const LATE_US: f64 = 8.5;
/// Longest time that an edge is on its way, in us: 1,200 m of cable.
const CABLE_US: f64 = 6.0;
/// Largest error of a crystal in ppm.
const PPM: f64 = 200.0;
/// Time from the end of a reply to the next request of function 70, in bits.
const PAUSE_BITS: f64 = 38.5;

pub struct Bus {
    pub rng: StdRng,
    pub units: Vec<Unit>,
    /// The present time in us.
    pub now: f64,
    pub bit: f64,
    /// Probability that a receiver gets a bit wrong.
    pub errors: f64,
    windows: Windows,
    fraction: f64,
    times: Times,
}

impl Bus {
    pub fn new(baud: u32, count: u8, errors: f64, seed: u64) -> Self {
        let mut rng = StdRng::seed_from_u64(seed);
        let bit = 1e6 / f64::from(baud);
        // The longest reply of a clone, with a bit between characters, takes 65,536 ticks. A fraction is 1/65,536 of a tick.
        let fraction = (256.0 * 12.0 * bit + 1_000.0) / 65_536.0 / 65_536.0;
        let fractions = |us: f64| (us / fraction) as u32;
        let units = (1..=count)
            .map(|n| {
                let place = extreme(&mut rng, CABLE_US);
                let error = extreme(&mut rng, 2.0 * PPM) - PPM;
                // Addresses over the whole range.
                let address = (u16::from(n) * 247 / u16::from(count)) as u8;
                Unit::new(address, place, 1.0 + error * 1e-6, 0, 0.0)
            })
            .collect();
        Self {
            rng,
            units,
            now: 0.0,
            bit,
            errors,
            windows: Windows::new(fractions(bit), fractions(1.0)),
            fraction,
            times: Times {
                t15: (16.5 * bit).max(750.0),
                t35: (38.5 * bit).max(1_750.0),
            },
        }
    }

    fn characters(&self, count: usize) -> f64 {
        count as f64 * 11.0 * self.bit
    }

    /// Returns bytes as a receiver gets them.
    fn received(&mut self, bytes: &[u8]) -> Vec<u8> {
        if self.errors == 0.0 {
            return bytes.to_vec();
        }
        let of_byte = 8.0 * self.errors;
        let mut flip = |byte: u8| {
            let hit = self.rng.random_bool(of_byte);
            byte ^ if hit {
                1 << self.rng.random_range(0..8)
            } else {
                0
            }
        };
        bytes.iter().map(|byte| flip(*byte)).collect()
    }

    /// Passes bytes from `start` on to all units but one, each with its own errors.
    fn deliver(&mut self, bytes: &[u8], start: f64, sender: Option<usize>) {
        let end = start + self.characters(bytes.len());
        for n in (0..self.units.len()).filter(|n| Some(*n) != sender) {
            let bytes = self.received(bytes);
            self.units[n].receive(&bytes, start, end, self.times);
        }
    }

    /// Sends a request, and returns what the master gets. `arbitrates`: it is a fetch; a usual request is over when the
    /// line has been silent.
    pub fn ask(&mut self, request: &[u8], arbitrates: bool) -> Vec<u8> {
        self.deliver(request, self.now, None);
        self.now += self.characters(request.len());
        let ended = self.now;
        let answer = if arbitrates {
            for unit in &mut self.units {
                unit.serve(ended, self.windows);
            }
            self.arbitrate(ended)
        } else {
            self.now += self.times.t35;
            let mut replies = Vec::new();
            for (n, unit) in self.units.iter_mut().enumerate() {
                unit.pass_silence(self.now, self.times);
                let reply = unit.serve(self.now, self.windows);
                replies.extend(reply.map(|reply| (n, reply)));
            }
            assert!(replies.len() <= 1, "two units reply");
            replies.pop()
        };
        let Some((sender, reply)) = answer else {
            // A usual master waits for 50 ms, one of function 70 as long as there may be a start bit.
            let length = f64::from(self.windows.length) * self.fraction;
            let wait = 20.0 * self.bit + 800.0 + 9.0 * length;
            self.now = ended + if arbitrates { wait } else { 50_000.0 };
            return Vec::new();
        };
        self.deliver(&reply, self.now, Some(sender));
        self.now += self.characters(reply.len());
        let bytes = self.received(&reply);
        self.now += if arbitrates {
            PAUSE_BITS * self.bit
        } else {
            self.times.t35
        };
        bytes
    }

    /// Lets the units arbitrate after a request that ended at `ended`. Returns the reply of the winner and its index.
    fn arbitrate(&mut self, ended: f64) -> Option<(usize, Vec<u8>)> {
        let length = f64::from(self.windows.length) * self.fraction;
        // Start bits so far: unit, and time at its place.
        let mut sent: Vec<(usize, f64)> = Vec::new();
        let mut winner = None;
        loop {
            // The turns of the units in the next window. Nobody sees a start bit of a later one in it.
            let mut turns: Vec<(f64, usize)> = Vec::new();
            for (n, unit) in self.units.iter_mut().enumerate() {
                if let Some(deadline) = unit.port().deadline() {
                    let at = ended + unit.place + f64::from(deadline) * self.fraction * unit.pace;
                    turns.push((at + extreme(&mut self.rng, LATE_US), n));
                }
            }
            turns.sort_by(|a, b| a.0.total_cmp(&b.0));
            let Some(&(first, _)) = turns.first() else {
                return winner;
            };
            turns.retain(|(at, _)| *at < first + length / 2.0);
            let mut started = None;
            for (now, n) in turns {
                let (place, pace) = (self.units[n].place, self.units[n].pace);
                let seen = sent
                    .iter()
                    .filter(|(other, _)| *other != n)
                    .map(|(other, at)| at + (self.units[*other].place - place).abs())
                    .filter(|at| *at <= now)
                    .max_by(f64::total_cmp);
                let port = self.units[n].port();
                if let Some(at) = seen {
                    port.fell(((at - ended - place) / pace / self.fraction) as i64 as u32);
                }
                match port.turn() {
                    Turn::None => {}
                    Turn::Bit(_) => {
                        port.sent();
                        sent.push((n, now));
                        started = Some((n, now));
                    }
                    Turn::Reply(byte) => {
                        let mut reply = vec![byte];
                        reply.extend(std::iter::from_fn(|| port.next_byte()));
                        port.sent();
                        assert!(winner.is_none(), "two units have won");
                        self.now = now + place;
                        winner = Some((n, reply));
                    }
                }
            }
            // The others receive the characters of a window as one. Overlapping start bits make it another one.
            if let Some((n, at)) = started {
                let overlap = sent.len() > 1 && self.rng.random_bool(0.2);
                self.deliver(&[if overlap { 0xFC } else { 0xFF }], at, Some(n));
            }
            sent.retain(|(_, at)| *at > first - 2.0 * length);
        }
    }
}

/// Returns 0, the limit, or a value between them, because the worst is often at the ends.
fn extreme(rng: &mut StdRng, limit: f64) -> f64 {
    *[0.0, limit, rng.random_range(0.0..=limit)]
        .choose(rng)
        .unwrap()
}
