//! The master's end of the line: what it queues to send, and what it receives.

use std::collections::VecDeque;

use super::{Character, Line, Span};
use crate::serial::Wave;
use crate::time::Time;

/// A character that the master received while the unit was sending.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received {
    /// Its data bits, the parity bit not among them.
    pub byte: u8,
    /// The falling edge of its start bit.
    pub start: Time,
    /// The end of its last stop bit, by the master's rate.
    pub end: Time,
    /// The parity bit was wrong.
    pub parity_error: bool,
    /// The first stop bit was low.
    pub framing_error: bool,
    /// The samples of some bit were not of one mind.
    pub noise: bool,
    /// The master, or another unit, was sending at the same time.
    pub collided: bool,
}

impl Received {
    /// Whether the byte can be trusted.
    #[must_use]
    pub const fn is_good(&self) -> bool {
        !(self.parity_error || self.framing_error || self.noise || self.collided)
    }
}

/// The master's transmitter.
#[derive(Clone, Debug, Default)]
pub(super) struct Master {
    /// Its level, the future it has queued included.
    pub(super) wave: Wave,
    /// When it is sending, now and in the future; neighbours do not touch.
    pub(super) talking: VecDeque<Span>,
    pub(super) queued_until: Time,
    /// Grows with everything that is queued.
    pub(super) version: u64,
}

impl Master {
    /// Queues `character` where it stands in time; not before what is queued.
    fn push(&mut self, character: &Character, end: Time) {
        for bit in 0..character.bits {
            self.wave.push(
                character.start + character.bit * u64::from(bit),
                character.level(bit),
            );
        }
        self.wave.push(character.end(), true);
        match self.talking.back_mut() {
            Some(span) if span.end == character.start => span.end = end,
            _ => self.talking.push_back(Span {
                start: character.start,
                end,
            }),
        }
        self.queued_until = end;
        self.version += 1;
    }
}

impl Line {
    /// The master sends `bytes` in its own settings, without gaps, the first start bit at `at`: later when
    /// something is still queued, now when `at` is past. Returns the end of the last stop bit.
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

    /// The master sends one character of any shape at `at`, or as soon after as what is queued is out.
    /// Returns its end.
    pub fn send_character(&mut self, at: Time, character: Character) -> Time {
        let character = character.at(at.max(self.master_free()));
        self.master.push(&character, character.end());
        character.end()
    }

    /// Noise inverts the bus from `at` for `width`: it is a low pulse on an idle line, or an inverted part of a
    /// character. Bursts come in order. When one begins before the end of the last one, only its rest behind that end
    /// counts.
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

    /// When everything the master has queued is out; now when that is past.
    #[must_use]
    pub fn master_free(&self) -> Time {
        self.master.queued_until.max(self.earliest())
    }

    /// What the master has received from the unit, oldest first: the last 65 536 characters unless everything
    /// is kept. It does not hear itself.
    pub fn received(&self) -> impl DoubleEndedIterator<Item = &Received> {
        self.received.iter()
    }

    /// The same, and forgets it.
    pub fn take_received(&mut self) -> Vec<Received> {
        self.received.drain(..).collect()
    }
}
