//! An asynchronous receiver: turns a level over time into words, sampling at its own bit centres.
//!
//! One model serves every listener: the USART of the part, the master, and the record of the line. It
//! samples each bit sixteen times and decides by three of them, as the STM32's USART does (RM0008
//! 27.3.3): sample `n` of a bit is taken `n` sixteenths of a bit after the bit began, counted from the
//! falling edge of the start bit. The part's samples go by a clock of their own ([`Framing::sampled_since`]), so
//! there the first sample of a start bit is the first one after the edge. A start bit is a falling edge after three high samples, with at least two
//! lows among samples 3, 5, 7 and again among 8, 9, 10; otherwise the search goes on.

#[cfg(test)]
mod tests;

use super::settings::{Parity, Rate, Settings};
use super::wave::Wave;
use crate::time::Time;

/// How a receiver divides what it receives into words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Framing {
    /// The receiver's own bit rate.
    pub rate: Rate,
    /// Data bits, the parity bit counted in: 7 to 9.
    pub data_bits: u8,
    /// The parity expected in the last data bit, if any.
    pub parity: Option<Parity>,
    /// Stop bits: 1 or 2. Only the first is checked.
    pub stop_bits: u8,
    /// Since when a sample is taken every sixteenth of a bit. `None`: the samples start with the edge of a start
    /// bit.
    pub sampled_since: Option<Time>,
}

impl Framing {
    /// The framing of a line end with these settings.
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

    /// The data bits of a word without the parity bit.
    #[must_use]
    pub const fn payload(&self, data: u16) -> u16 {
        let bits = self.data_bits - self.parity.is_some() as u8;
        data & !(u16::MAX << bits)
    }

    /// Bits of a whole character, start and stop bits included.
    #[must_use]
    pub const fn bits(&self) -> u8 {
        1 + self.data_bits + self.stop_bits
    }

    /// Where a start bit begins by the samples when its edge comes at `edge`: a sixteenth before the first sample
    /// that shows it.
    fn start_of(&self, edge: Time) -> Time {
        let Some(since) = self.sampled_since.filter(|&since| since < edge) else {
            return edge;
        };
        let (_, first) = self.rate.ticks(16, edge - since);
        // Rounded so that the first sample is never before the edge.
        since + first - self.rate.sixteenths(1)
    }

    /// From the start bit's edge to the last sample (the tenth) of the first stop bit.
    fn until_stop_sample(&self) -> Time {
        self.rate
            .sixteenths(16 * (1 + u64::from(self.data_bits)) + 10)
    }

    /// From the start bit's edge to the word being there: the last sample of a single stop bit, the end
    /// of the first of two (RM0008 27.3.3, "Configurable stop bits during reception").
    fn until_word(&self) -> Time {
        if self.stop_bits == 2 {
            self.rate.bits(2 + u64::from(self.data_bits))
        } else {
            self.until_stop_sample()
        }
    }
}

/// A word received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Word {
    /// The falling edge of the start bit, by the samples.
    pub start: Time,
    /// When the receiver had it.
    pub at: Time,
    /// When its last stop bit ends, by the receiver's rate.
    pub end: Time,
    /// The data bits, the parity bit in the highest.
    pub data: u16,
    /// The parity bit was wrong.
    pub parity_error: bool,
    /// The first stop bit was low.
    pub framing_error: bool,
    /// The samples of some bit were not of one mind.
    pub noise: bool,
}

/// The state of a receiver between two looks at its wire.
#[derive(Clone, Copy, Debug, Default)]
pub struct Receiver {
    /// Edges up to here are of no interest any more.
    search_from: Time,
    /// The falling edge of the character under way.
    start: Option<Time>,
    /// Its start bit has been sampled and stands.
    confirmed: bool,
}

impl Receiver {
    /// A receiver that starts to listen at `now`: it needs a falling edge after that.
    #[must_use]
    pub const fn listening_from(now: Time) -> Self {
        Self {
            search_from: now,
            start: None,
            confirmed: false,
        }
    }

    /// Whether it waits for a start bit.
    #[must_use]
    pub const fn is_idle(&self) -> bool {
        self.start.is_none()
    }

    /// The falling edge of the character under way.
    #[must_use]
    pub const fn start(&self) -> Option<Time> {
        self.start
    }

    /// When the character under way will be there, if it is one.
    #[must_use]
    pub fn due(&self, framing: &Framing) -> Option<Time> {
        self.start.map(|start| start + framing.until_word())
    }

    /// Edges before this instant are not needed any more.
    #[must_use]
    pub fn needs_from(&self) -> Time {
        self.start.unwrap_or(self.search_from)
    }

    /// The next word that is there by `now`, or `None`. The wave must be known up to `now`; call again
    /// until it says `None`.
    pub fn next_word(&mut self, wave: &Wave, framing: &Framing, now: Time) -> Option<Word> {
        loop {
            let start = match self.start {
                Some(start) => start,
                None => self.find_start(wave, framing, now)?,
            };
            if !self.confirmed {
                match start_bit_fails(wave, framing, start, now) {
                    Verdict::Open => return None,
                    Verdict::Fails(at) => {
                        *self = Self::listening_from(at);
                        continue;
                    }
                    Verdict::Stands => self.confirmed = true,
                }
            }
            if now < start + framing.until_word() {
                return None;
            }
            *self = Self::listening_from(start + framing.until_stop_sample());
            return Some(sample_word(wave, framing, start));
        }
    }

    /// Looks for a falling edge up to `now` after a high of three samples.
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

/// What the samples of a start bit say.
enum Verdict {
    /// Not all of them have been taken.
    Open,
    /// It was a glitch; the receiver knew this at the given instant.
    Fails(Time),
    /// It is a start bit.
    Stands,
}

fn start_bit_fails(wave: &Wave, framing: &Framing, start: Time, now: Time) -> Verdict {
    // A pulse between two samples has not been seen at all.
    let first = start + framing.rate.sixteenths(1);
    if framing.sampled_since.is_some() {
        if now < first {
            return Verdict::Open;
        }
        if wave.level_at(first) {
            return Verdict::Fails(first);
        }
    }
    for group in [[3, 5, 7], [8, 9, 10]] {
        let last = start + framing.rate.sixteenths(group[2]);
        if now < last {
            return Verdict::Open;
        }
        if highs(wave, framing, start, 0, group) > 1 {
            return Verdict::Fails(last);
        }
    }
    Verdict::Stands
}

/// How many of three samples of bit `bit` are high.
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
