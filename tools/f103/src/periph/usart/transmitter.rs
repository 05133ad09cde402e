//! The transmitting half of a USART: transmit data register, shift register, and their times.

use crate::serial::{Character, Rate, Wave};
use crate::time::Time;

/// What a transmitter does to its TX pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sent {
    /// A character whose start bit has begun, or begins at the next tick of the baud generator.
    Character(Character),
    /// The pin goes high: the rest of the character under way is lost.
    Cut(Time),
}

impl Sent {
    /// Sets the levels of `wave` accordingly.
    pub fn put_on(self, wave: &mut Wave) {
        match self {
            Self::Character(character) => wave.push_character(&character),
            Self::Cut(at) => {
                wave.truncate(at);
                wave.push(at, true);
            }
        }
    }
}

/// Format and bit length of the next character.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Cycles of the kernel clock in one bit: BRR.
    pub bit_cycles: u32,
    /// The kernel clock in Hz.
    pub hz: u32,
    /// Since when the baud generator runs.
    pub since: Time,
    /// Data bits, the parity bit counted in: 8 or 9.
    pub data_bits: u8,
    /// Stop bits: 1 or 2.
    pub stop_bits: u8,
    /// Idle bits in front of a character that follows another one.
    pub idle_bits: u8,
}

/// What occupies the shift register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Content {
    /// The bit of delay and the idle frame that follow the setting of TE.
    Preamble,
    /// A character.
    Data,
    /// A break frame.
    Break,
}

/// What the end of a character means to the registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The next transmission has begun immediately.
    More {
        /// Whether the transmit data register was moved to the shift register.
        took_data: bool,
    },
    /// Nothing is left to send.
    Complete,
}

/// Transmit data register and shift register.
#[derive(Clone, Debug, Default)]
pub struct Transmitter {
    data: Option<u16>,
    shift: Option<(Content, Time)>,
    preamble: bool,
    break_wanted: bool,
    /// The instant the present run of characters without a gap began, and the cycles it has lasted.
    base: Time,
    cycles: u64,
    hz: u32,
    sent: Vec<Sent>,
}

impl Transmitter {
    /// Returns an empty transmitter that still has to report what was sent before a reset.
    pub fn with_sent(sent: Vec<Sent>) -> Self {
        Self {
            sent,
            ..Self::default()
        }
    }

    /// Returns the end of what is in the shift register.
    pub fn shift_end(&self) -> Option<Time> {
        self.shift.map(|(_, end)| end)
    }

    /// Returns whether a character or a break is being sent.
    pub fn is_sending(&self) -> bool {
        matches!(self.shift, Some((Content::Data | Content::Break, _)))
    }

    /// Returns whether the transmit data register holds a word that has not begun.
    pub fn holds_data(&self) -> bool {
        self.data.is_some()
    }

    /// Puts a word, parity bit included, into the transmit data register.
    pub fn set_data(&mut self, word: u16) {
        self.data = Some(word);
    }

    /// Requests the preamble as the next transmission: TE has been set.
    pub fn want_preamble(&mut self) {
        self.preamble = true;
    }

    /// Requests a break after the character under way, or withdraws the request: SBK.
    pub fn want_break(&mut self, wanted: bool) {
        self.break_wanted = wanted;
    }

    /// Starts what waits, at the first tick of the baud generator from `at` on, if the shift register is free. Returns
    /// what was started.
    pub fn start(&mut self, at: Time, shape: Shape) -> Option<Ended> {
        self.begin(at, shape, false)
    }

    /// The same. `follows`: a character or a break has ended at this instant.
    fn begin(&mut self, at: Time, shape: Shape, follows: bool) -> Option<Ended> {
        if self.shift.is_some() {
            return None;
        }
        if at != self.end_of_run() || self.hz != shape.hz {
            // The next tick of the baud generator.
            let rate = Rate::from_clock(shape.bit_cycles, shape.hz);
            let (_, tick) = rate.ticks(1, at.saturating_sub(shape.since));
            self.base = shape.since + tick;
            self.cycles = 0;
            self.hz = shape.hz;
        }
        let frame = 1 + shape.data_bits + shape.stop_bits;
        if std::mem::take(&mut self.preamble) {
            // RM0008 27.6.4, TE: one bit time of delay; 27.3.2: then a frame of ones.
            self.occupy(Content::Preamble, 1 + frame, shape);
            return Some(Ended::More { took_data: false });
        }
        let rate = Rate::from_clock(shape.bit_cycles, shape.hz);
        let start = self.end_of_run();
        if std::mem::take(&mut self.break_wanted) {
            // RM0008 27.3.2: 10 or 11 low bits, then the stop bits.
            let low = 2 + shape.data_bits;
            let mut frame = Character::line_break(rate, low).at(start);
            frame.bits = low + shape.stop_bits;
            frame.levels |= 1 << (frame.bits - 1);
            self.sent.push(Sent::Character(frame));
            self.occupy(Content::Break, frame.bits, shape);
            return Some(Ended::More { took_data: false });
        }
        let word = self.data.take()?;
        if follows {
            self.cycles += u64::from(shape.idle_bits) * u64::from(shape.bit_cycles);
        }
        let start = self.end_of_run();
        let character = Character::raw(start, rate, word, shape.data_bits, shape.stop_bits);
        self.sent.push(Sent::Character(character));
        self.occupy(Content::Data, frame, shape);
        Some(Ended::More { took_data: true })
    }

    /// Empties the shift register at `at`, when it said it would be empty. `shape` is `None` when the transmitter may
    /// not begin anything new. Also returns whether it was a break that ended.
    pub fn finish(&mut self, at: Time, shape: Option<Shape>) -> (Ended, bool) {
        let was_break = matches!(self.shift, Some((Content::Break, _)));
        let follows = self.is_sending();
        self.shift = None;
        let next = shape.and_then(|shape| self.begin(at, shape, follows));
        (next.unwrap_or(Ended::Complete), was_break)
    }

    /// Clears TE at `now`: a character under way is lost. Returns whether it was a character or a break.
    pub fn stop(&mut self, now: Time) -> bool {
        let sending = self.is_sending();
        if sending {
            self.sent.push(Sent::Cut(now));
        }
        self.shift = None;
        self.preamble = false;
        sending
    }

    /// Returns whether something was sent since the last [`Transmitter::take_sent`].
    pub fn has_sent(&self) -> bool {
        !self.sent.is_empty()
    }

    /// Takes what was sent since the last call.
    pub fn take_sent(&mut self) -> Vec<Sent> {
        std::mem::take(&mut self.sent)
    }

    fn occupy(&mut self, content: Content, bits: u8, shape: Shape) {
        self.cycles += u64::from(bits) * u64::from(shape.bit_cycles);
        self.shift = Some((content, self.end_of_run()));
    }

    fn end_of_run(&self) -> Time {
        if self.hz == 0 {
            return self.base;
        }
        self.base + Time::cycles(self.cycles, self.hz)
    }
}
