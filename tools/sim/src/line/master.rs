//! The master's end of the line: its queue of characters to send, and the characters that it receives.

use std::collections::VecDeque;

use super::{Character, Line, Span};
use f103::serial::Wave;
use f103::time::Time;

/// A character that the master has received while a unit was sending.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received {
    /// Data bits without the parity bit.
    pub byte: u8,
    /// Falling edge of the start bit.
    pub start: Time,
    /// End of the last stop bit, by the master's rate.
    pub end: Time,
    /// Whether the parity bit was wrong.
    pub parity_error: bool,
    /// Whether the first stop bit was low.
    pub framing_error: bool,
    /// Whether the samples of a bit had different levels.
    pub noise: bool,
    /// Whether the master or another unit was sending at the same time.
    pub collided: bool,
}

impl Received {
    /// Returns whether the character has no error.
    #[must_use]
    pub const fn is_good(&self) -> bool {
        !(self.parity_error || self.framing_error || self.noise || self.collided)
    }
}

/// The master's transmitter.
#[derive(Clone, Debug, Default)]
pub(super) struct Master {
    /// Level of the transmitter, with the characters that are queued.
    pub(super) wave: Wave,
    /// Times in which the master sends, now and in the future. Adjoining times are joined.
    pub(super) sending: VecDeque<Span>,
    /// End of the last character that is queued.
    pub(super) queued_until: Time,
    /// Increases with every character and every noise pulse that is queued.
    pub(super) version: u64,
}

impl Master {
    /// Queues `character` at its start time, which must not be before the end of the queue.
    fn push(&mut self, character: &Character, end: Time) {
        self.wave.push_character(character);
        self.wave.push(character.end(), true);
        match self.sending.back_mut() {
            Some(span) if span.end == character.start => span.end = end,
            _ => self.sending.push_back(Span {
                start: character.start,
                end,
            }),
        }
        self.queued_until = end;
        self.version += 1;
    }
}

impl Line {
    /// Sends `bytes` from the master in its settings, without gaps. The first start bit begins at `at`, or now if `at`
    /// is in the past, or after the characters that are still queued. Returns the end of the last stop bit.
    pub fn send(&mut self, at: Time, bytes: &[u8]) -> Time {
        let start = at.max(self.master_free());
        let (settings, rate) = (self.settings, self.settings.rate());
        let bits = u64::from(settings.format.bits());
        let mut from = start;
        for (&byte, n) in bytes.iter().zip(1..) {
            let end = start + rate.bits(n * bits);
            self.master
                .push(&Character::new(settings, byte).at(from), end);
            from = end;
        }
        from
    }

    /// Sends a character of any shape from the master at `at`, or now if `at` is in the past, or after the characters
    /// that are still queued. Returns the end of the character.
    pub fn send_character(&mut self, at: Time, character: Character) -> Time {
        let character = character.at(at.max(self.master_free()));
        self.master.push(&character, character.end());
        character.end()
    }

    /// Queues a noise pulse that inverts the bus from `at` for `width`: a low pulse on an idle line, or an inverted
    /// part of a character. Pulses must be queued in time order. If a pulse begins before the end of the last one, only
    /// the part after that end has an effect.
    pub fn noise(&mut self, at: Time, width: Time) {
        let end = at + width;
        let start = at.max(self.earliest());
        let start = self
            .noise
            .previous_edge(Time::MAX)
            .map_or(start, |last| last.max(start));
        if start < end {
            self.master.version += 1;
            self.noise.push(start, false);
            self.noise.push(end, true);
        }
    }

    /// Returns the instant at which the master has sent everything that is queued; now if that is in the past.
    #[must_use]
    pub fn master_free(&self) -> Time {
        self.master.queued_until.max(self.earliest())
    }

    /// Returns the characters that the master has received from units, oldest first: the last 65 536, or all if
    /// everything is kept. The master does not receive its own characters.
    pub fn received(&self) -> impl DoubleEndedIterator<Item = &Received> {
        self.received.iter()
    }

    /// Returns the characters that the master has received since the last call, oldest first. Removes them from
    /// [`received`](Self::received).
    pub fn take_received(&mut self) -> Vec<Received> {
        self.received.drain(..).collect()
    }
}
