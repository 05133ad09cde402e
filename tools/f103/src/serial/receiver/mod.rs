//! An asynchronous receiver: turns a level over time into words, by sampling at its own rate.
//!
//! The USART of the part, the master, and the record of the line use the same model. It samples each bit sixteen times
//! and decides by three of the samples, as the STM32's USART does (RM0008 27.3.3). Sample `n` of a bit is taken `n`
//! sixteenths of a bit after the start of the bit, counted from the falling edge of the start bit. The sampling clock
//! of the USART runs freely ([`Framing::sampled_since`]), so its first sample of a start bit is the first one after the
//! edge.
//!
//! A start bit is a falling edge after three high samples, with at least two low levels among the samples 3, 5 and 7,
//! and at least two among 8, 9 and 10. After any other falling edge, the receiver searches for the next one.

#[cfg(test)]
mod tests;

use super::settings::{Parity, Rate, Settings};
use super::wave::Wave;
use crate::time::Time;

/// Settings by which a receiver divides the level of its wire into words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Framing {
    /// Bit rate of the receiver.
    pub rate: Rate,
    /// Number of data bits with the parity bit: 7 to 9.
    pub data_bits: u8,
    /// Parity that is expected in the last data bit; `None` if the last data bit is not a parity bit.
    pub parity: Option<Parity>,
    /// Number of stop bits: 1 or 2. Only the first is checked.
    pub stop_bits: u8,
    /// Start of a sampling clock that ticks sixteen times in a bit. `None` if the samples count from the edge of each
    /// start bit.
    pub sampled_since: Option<Time>,
}

impl Framing {
    /// Returns the framing of an end of the line with these settings.
    #[must_use]
    pub const fn of(settings: Settings) -> Self {
        let parity = settings.format.parity();
        Self {
            rate: settings.rate(),
            data_bits: settings.format.data_bits() + parity.is_some() as u8,
            parity,
            stop_bits: settings.format.stop_bits(),
            sampled_since: None,
        }
    }

    /// Returns the data bits of a word without the parity bit.
    #[must_use]
    pub const fn payload(&self, data: u16) -> u16 {
        let bits = self.data_bits - self.parity.is_some() as u8;
        data & !(u16::MAX << bits)
    }

    /// Returns the number of bits in a character, with the start and stop bits.
    #[must_use]
    pub const fn bits(&self) -> u8 {
        1 + self.data_bits + self.stop_bits
    }

    /// Returns the start of a start bit by the samples, when its edge is at `edge`: a sixteenth of a bit before the
    /// first sample after the edge.
    fn start_of(&self, edge: Time) -> Time {
        let Some(since) = self.sampled_since.filter(|&since| since < edge) else {
            return edge;
        };
        let (_, first) = self.rate.ticks(16, edge - since);
        // Rounded so that the first sample is never before the edge.
        since + first - self.rate.sixteenths(1)
    }

    /// Returns the time from the start bit's edge to the last sample (the tenth) of the first stop bit.
    fn until_stop_sample(&self) -> Time {
        self.rate
            .sixteenths(16 * (1 + u64::from(self.data_bits)) + 10)
    }

    /// Returns the time from the start bit's edge until the word is received: to the last sample of a single stop bit,
    /// or to the end of the first of two stop bits (RM0008 27.3.3, "Configurable stop bits during reception").
    fn until_word(&self) -> Time {
        if self.stop_bits == 2 {
            self.rate.bits(2 + u64::from(self.data_bits))
        } else {
            self.until_stop_sample()
        }
    }
}

/// A received word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Word {
    /// Returns the falling edge of the start bit, by the samples.
    pub start: Time,
    /// Instant at which the word was received.
    pub at: Time,
    /// End of the last stop bit, by the receiver's rate.
    pub end: Time,
    /// Data bits, with the parity bit as the highest.
    pub data: u16,
    /// Whether the parity bit was wrong.
    pub parity_error: bool,
    /// Whether the first stop bit was low.
    pub framing_error: bool,
    /// Whether the samples of a bit had different levels.
    pub noise: bool,
}

/// The state of a receiver.
#[derive(Clone, Copy, Debug, Default)]
pub struct Receiver {
    /// The search for a start bit continues after this instant.
    search_from: Time,
    /// Falling edge of the character that is being received.
    start: Option<Time>,
    /// Whether the samples have confirmed the start bit.
    confirmed: bool,
}

impl Receiver {
    /// Returns a receiver that is enabled at `now`. Its first character begins with a falling edge after `now`.
    #[must_use]
    pub const fn listening_from(now: Time) -> Self {
        Self {
            search_from: now,
            start: None,
            confirmed: false,
        }
    }

    /// Returns whether the receiver waits for a start bit.
    #[must_use]
    pub const fn is_idle(&self) -> bool {
        self.start.is_none()
    }

    /// Falling edge of the character that is being received.
    #[must_use]
    pub const fn start(&self) -> Option<Time> {
        self.start
    }

    /// Returns the instant at which the character that is being received will be complete, if it is no glitch.
    #[must_use]
    pub fn due(&self, framing: &Framing) -> Option<Time> {
        self.start.map(|start| start + framing.until_word())
    }

    /// Returns the instant before which the receiver needs no edges any more.
    #[must_use]
    pub fn needs_from(&self) -> Time {
        self.start.unwrap_or(self.search_from)
    }

    /// Returns the next word that was received by `now`. Call this again until it returns `None`. The wave must be
    /// known up to `now`.
    pub fn next_word(&mut self, wave: &Wave, framing: &Framing, now: Time) -> Option<Word> {
        loop {
            let start = match self.start {
                Some(start) => start,
                None => self.find_start(wave, framing, now)?,
            };
            if !self.confirmed {
                match check_start_bit(wave, framing, start, now) {
                    StartBit::Unknown => return None,
                    StartBit::Glitch(at) => {
                        *self = Self::listening_from(at);
                        continue;
                    }
                    StartBit::Confirmed => self.confirmed = true,
                }
            }
            if now < start + framing.until_word() {
                return None;
            }
            *self = Self::listening_from(start + framing.until_stop_sample());
            return Some(sample_word(wave, framing, start));
        }
    }

    /// Searches for a falling edge up to `now` that follows a high level of at least three samples.
    fn find_start(&mut self, wave: &Wave, framing: &Framing, now: Time) -> Option<Time> {
        let idle = framing.rate.sixteenths(3);
        let mut from = self.search_from;
        while let Some(edge) = wave.next_fall(from).filter(|&edge| edge <= now) {
            let rested = wave
                .previous_edge(edge)
                .is_none_or(|rise| rise + idle <= edge);
            if rested {
                let start = framing.start_of(edge);
                self.start = Some(start);
                return Some(start);
            }
            from = edge;
            self.search_from = edge;
        }
        None
    }
}

/// Result of checking the samples of a start bit.
enum StartBit {
    /// Not all samples have been taken.
    Unknown,
    /// It was a glitch. The receiver detected this at the given instant.
    Glitch(Time),
    /// It is a start bit.
    Confirmed,
}

fn check_start_bit(wave: &Wave, framing: &Framing, start: Time, now: Time) -> StartBit {
    // The USART does not detect a pulse between two samples.
    let first = start + framing.rate.sixteenths(1);
    if framing.sampled_since.is_some() {
        if now < first {
            return StartBit::Unknown;
        }
        if wave.level_at(first) {
            return StartBit::Glitch(first);
        }
    }
    for group in [[3, 5, 7], [8, 9, 10]] {
        let last = start + framing.rate.sixteenths(group[2]);
        if now < last {
            return StartBit::Unknown;
        }
        if highs(wave, framing, start, 0, group) > 1 {
            return StartBit::Glitch(last);
        }
    }
    StartBit::Confirmed
}

/// Returns the number of high levels among three samples of bit `bit`.
fn highs(wave: &Wave, framing: &Framing, start: Time, bit: u8, samples: [u64; 3]) -> usize {
    samples
        .into_iter()
        .filter(|n| wave.level_at(start + framing.rate.sixteenths(16 * u64::from(bit) + n)))
        .count()
}

fn sample_word(wave: &Wave, framing: &Framing, start: Time) -> Word {
    let mut noise = highs(wave, framing, start, 0, [3, 5, 7]) != 0;
    let mut sample = |bit| {
        let highs = highs(wave, framing, start, bit, [8, 9, 10]);
        noise |= highs == 1 || highs == 2;
        highs >= 2
    };
    sample(0);
    let data = (0..framing.data_bits)
        .map(|bit| u16::from(sample(1 + bit)) << bit)
        .sum::<u16>();
    let framing_error = !sample(1 + framing.data_bits);
    let parity_error = framing.parity.is_some_and(|parity| {
        let top = framing.data_bits - 1;
        let payload = data & !(1 << top);
        parity.bit(payload) != (data >> top & 1 == 1)
    });
    Word {
        start,
        at: start + framing.until_word(),
        end: start + framing.rate.bits(u64::from(framing.bits())),
        data,
        parity_error,
        framing_error,
        noise,
    }
}
