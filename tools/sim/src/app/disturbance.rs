//! Random disturbances of the line: inverted bits, noise pulses, and bytes lost on the way to and from the client. The
//! random generator has a fixed seed, so that a run in virtual time repeats.

use fastrand::Rng;
use sim::Time;
use sim::line::Line;

/// Width of a noise pulse.
const PULSE: Time = Time::from_us(5);
const PS_PER_S: f64 = 1e12;

/// Rates of the disturbances, and when each occurs next.
#[derive(Debug)]
pub struct Disturbance {
    bit_error_rate: f64,
    noise_hz: f64,
    drop_rate: f64,
    bits: Strikes,
    pulses: Strikes,
    chance: Rng,
}

impl Default for Disturbance {
    /// Returns a quiet line.
    fn default() -> Self {
        Self {
            bit_error_rate: 0.0,
            noise_hz: 0.0,
            drop_rate: 0.0,
            bits: Strikes::default(),
            pulses: Strikes::default(),
            chance: Rng::with_seed(0x6D6F_6469),
        }
    }
}

impl Disturbance {
    /// Returns the probability that a bit time is inverted.
    pub fn bit_error_rate(&self) -> f64 {
        self.bit_error_rate
    }

    /// Returns the mean number of noise pulses per second.
    pub fn noise_hz(&self) -> f64 {
        self.noise_hz
    }

    /// Returns the share of bytes that are lost.
    pub fn drop_rate(&self) -> f64 {
        self.drop_rate
    }

    /// Sets the rates that are `Some`.
    pub fn change(
        &mut self,
        bit_error_rate: Option<f64>,
        noise_hz: Option<f64>,
        drop_rate: Option<f64>,
    ) {
        if let Some(rate) = bit_error_rate {
            (self.bit_error_rate, self.bits) = (rate, Strikes::default());
        }
        if let Some(rate) = noise_hz {
            (self.noise_hz, self.pulses) = (rate, Strikes::default());
        }
        self.drop_rate = drop_rate.unwrap_or(self.drop_rate);
    }

    /// Queues the disturbances of the line from `now` on and before `until`.
    pub fn put(&mut self, line: &mut Line, now: Time, until: Time) {
        let baud = line.settings().baud;
        let bits_hz = self.bit_error_rate * f64::from(baud);
        loop {
            let bit = self.bits.next(bits_hz, now, &mut self.chance);
            let pulse = self.pulses.next(self.noise_hz, now, &mut self.chance);
            // The line accepts noise in time order only.
            if bit.min(pulse) >= until {
                return;
            }
            if bit < pulse {
                line.noise(bit, Time::cycles(1, baud));
                self.bits.pass(bits_hz, &mut self.chance);
            } else {
                line.noise(pulse, PULSE);
                self.pulses.pass(self.noise_hz, &mut self.chance);
            }
        }
    }

    /// Returns the bytes that are not lost.
    pub fn not_dropped(&mut self, bytes: impl Iterator<Item = u8>) -> Vec<u8> {
        let (rate, chance) = (self.drop_rate, &mut self.chance);
        bytes
            .filter(|_| rate == 0.0 || chance.f64() >= rate)
            .collect()
    }
}

/// Random events with a mean rate.
#[derive(Debug, Default)]
struct Strikes(Option<Time>);

impl Strikes {
    /// Returns the time of the next event, not before `now`.
    fn next(&mut self, hz: f64, now: Time, chance: &mut Rng) -> Time {
        let at = *self.0.get_or_insert_with(|| now + pause(hz, chance));
        at.max(now)
    }

    /// Draws the time of the event after the next one.
    fn pass(&mut self, hz: f64, chance: &mut Rng) {
        self.0 = self.0.map(|at| at + pause(hz, chance));
    }
}

/// Returns a random time between two events with a mean rate of `hz`, exponentially distributed: at least 1 us. At 0 Hz
/// it is [`Time::MAX`]: there is no event.
fn pause(hz: f64, chance: &mut Rng) -> Time {
    if hz == 0.0 {
        return Time::MAX;
    }
    let seconds = -(1.0 - chance.f64()).ln() / hz;
    // The conversion saturates at the largest time.
    Time::from_us(1).max(Time::from_ps((seconds * PS_PER_S) as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn edges(disturbance: &mut Disturbance, seconds: u64) -> usize {
        let mut line = Line::default();
        let mut edges = 0;
        for ms in (0..seconds * 1000).step_by(50) {
            let (from, to) = (Time::from_ms(ms), Time::from_ms(ms + 50));
            disturbance.put(&mut line, from, to);
            sim::periph::usart::Wire::advance(&mut line, to);
            edges += line.falling_edges(from, to).count();
        }
        edges
    }

    #[test]
    fn pause_at_a_rate_of_zero_never_ends() {
        let mut chance = Rng::with_seed(1);
        assert_eq!(pause(0.0, &mut chance), Time::MAX);
        let mut strikes = Strikes::default();
        let late = Time::from_secs(100 * 3600);
        assert_eq!(strikes.next(0.0, late, &mut chance), Time::MAX);
    }

    #[test]
    fn pauses_have_the_mean_of_a_rate_below_one_an_hour() {
        let mut chance = Rng::with_seed(1);
        let pauses = (0..1000).map(|_| pause(1e-5, &mut chance).as_secs_f64());
        let mean = pauses.sum::<f64>() / 1000.0;
        assert!((90_000.0..110_000.0).contains(&mean), "{mean} s");
    }

    #[test]
    fn default_disturbance_leaves_the_line_idle() {
        assert_eq!(edges(&mut Disturbance::default(), 100), 0);
    }

    #[test]
    fn noise_and_bit_errors_occur_at_their_mean_rates() {
        let mut noisy = Disturbance::default();
        noisy.change(None, Some(50.0), None);
        let count = edges(&mut noisy, 100);
        assert!((4700..=5300).contains(&count), "{count} of 5000");

        let mut wrong = Disturbance::default();
        wrong.change(Some(1e-3), None, None);
        // 9600 bits in each of 100 seconds.
        let count = edges(&mut wrong, 100);
        assert!((870..=1050).contains(&count), "{count} of 960");

        noisy.change(None, Some(0.0), None);
        assert_eq!(
            edges(&mut noisy, 10),
            0,
            "no pulses after the rate was set to 0"
        );
    }

    #[test]
    fn drop_rate_is_the_share_of_lost_bytes() {
        let mut lossy = Disturbance::default();
        assert_eq!(lossy.not_dropped(0..100), (0..100).collect::<Vec<_>>());
        lossy.change(None, None, Some(0.25));
        let left = lossy.not_dropped((0..10_000).map(|n| n as u8)).len();
        assert!((7300..=7700).contains(&left), "{left} of 7500");
        lossy.change(None, None, Some(1.0));
        assert!(lossy.not_dropped(0..100).is_empty());
    }
}
