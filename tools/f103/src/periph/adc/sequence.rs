//! The regular sequence of a converter: the order of the channels, and the duration of each conversion.

use crate::time::Time;

/// Sample times in half ADCCLK cycles, by the code in SMPR (RM0008 11.12.4).
const SAMPLE: [u64; 8] = [3, 15, 27, 57, 83, 111, 143, 479];
/// The conversion itself: 12.5 cycles (11.6).
const CONVERSION: u64 = 25;

/// SQR1 to SQR3 and SMPR1 to SMPR2.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sequence {
    /// SQR1, SQR2, SQR3.
    pub sqr: [u32; 3],
    /// SMPR1, SMPR2.
    pub smpr: [u32; 2],
}

impl Sequence {
    /// Conversions in the sequence, 1 to 16: L + 1.
    pub const fn length(&self) -> usize {
        (self.sqr[0] >> 20 & 0xF) as usize + 1
    }

    /// Returns the channel of rank `rank`, from 0: SQ1 is the lowest of SQR3.
    pub const fn channel(&self, rank: usize) -> usize {
        let register = self.sqr[2 - rank / 6];
        (register >> (5 * (rank % 6)) & 0x1F) as usize
    }

    /// Returns the sampling time of a channel, in half cycles.
    pub const fn sample_halves(&self, channel: usize) -> u64 {
        let code = if channel < 10 {
            self.smpr[1] >> (3 * channel)
        } else {
            self.smpr[0] >> (3 * (channel - 10))
        };
        SAMPLE[(code & 7) as usize]
    }

    /// Returns the half cycles from the start of sampling to the result.
    pub const fn total_halves(&self, channel: usize) -> u64 {
        self.sample_halves(channel) + CONVERSION
    }
}

/// A run of conversions without a gap: its clock and its progress.
#[derive(Clone, Copy, Debug)]
pub struct Run {
    base: Time,
    /// Half cycles since `base` at which the conversion under way began.
    halves: u64,
    hz: u32,
    /// The rank under way, from 0.
    pub rank: usize,
    /// The channel under way.
    pub channel: usize,
    sample: u64,
    total: u64,
    /// The sampled code; `None` before the end of the sampling.
    pub sampled: Option<u16>,
}

impl Run {
    /// Starts with the first rank at `now`.
    pub fn start(sequence: &Sequence, hz: u32, now: Time) -> Self {
        let mut run = Self {
            base: now,
            halves: 0,
            hz,
            rank: 0,
            channel: 0,
            sample: 0,
            total: 0,
            sampled: None,
        };
        run.take(sequence, 0);
        run
    }

    /// Continues with rank `rank`, without a gap after the last conversion.
    pub fn next(&mut self, sequence: &Sequence, rank: usize) {
        self.halves += self.total;
        self.take(sequence, rank);
    }

    fn take(&mut self, sequence: &Sequence, rank: usize) {
        self.rank = rank;
        self.channel = sequence.channel(rank);
        self.sample = sequence.sample_halves(self.channel);
        self.total = sequence.total_halves(self.channel);
        self.sampled = None;
    }

    /// Returns the sampling time of the input, in seconds.
    pub fn sample_seconds(&self) -> f64 {
        self.sample as f64 / (2.0 * f64::from(self.hz))
    }

    /// Returns the instant at which the input is disconnected. The level at that instant is converted.
    pub fn sample_end(&self) -> Time {
        self.at(self.halves + self.sample)
    }

    /// Returns the instant at which the result is available.
    pub fn end(&self) -> Time {
        self.at(self.halves + self.total)
    }

    fn at(&self, halves: u64) -> Time {
        self.base + Time::cycles(halves, self.hz.saturating_mul(2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_and_sample_times_are_found_in_their_registers() {
        let sequence = Sequence {
            // L = 15; SQ13 = 1, SQ16 = 17; SQ7 = 2; SQ1 = 3, SQ6 = 9.
            sqr: [0x00F8_8001, 2, 9 << 25 | 3],
            // Channel 10: 7.5 cycles, 17: 239.5; channel 0: 1.5, 9: 71.5.
            smpr: [7 << 21 | 1, 6 << 27],
        };
        assert_eq!(sequence.length(), 16);
        let ranks = [0, 5, 6, 12, 15].map(|n| sequence.channel(n));
        assert_eq!(ranks, [3, 9, 2, 1, 17]);
        let halves = [0, 9, 10, 17].map(|n| sequence.total_halves(n));
        // 1.5, 71.5, 7.5, 239.5 plus 12.5 cycles.
        assert_eq!(halves, [28, 168, 40, 504]);
    }
}
