//! The RS-485 bus between the board and its master.
//!
//! Every talker is a level over time: the master, the unit through its driver, and noise. The bus is low
//! when either talker pulls it low (a wired AND: what a receiver makes of two drivers at once), and noise turns
//! it over. What a listener receives is sampled from that level at the listener's own rate, so a wrong rate, a
//! wrong parity, a break, a cut character or a collision come out as they do on a wire.
//!
//! ```text
//! master --- wave --+
//!                   AND -- XOR -- bus --+-- the unit's receiver (off while its driver is on)
//! USART1 - driver --+       |           +-- the listener: received(), frames
//! other units ------+     noise
//! ```
//!
//! Several boards share a bus in [`crate::bus`]: then each board has its own end of the line, and one more line is the
//! bus, with the master and the record.

mod frames;
mod master;
mod shared;
mod silence;
mod wiring;

#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use crate::periph::usart::TxPin;
pub use crate::serial::{Character, Format, Parity, Rate, Settings};
use crate::serial::{Receiver, Wave};
use crate::time::Time;
pub use frames::{Direction, Frame, KEPT, LONGEST, Record};
use master::Master;
pub use master::Received;
pub(crate) use shared::Said;
use shared::Shared;

/// How long the bus can be looked back at, [`Line::level_at`].
pub const HISTORY: Time = Time::from_ms(100);

/// Number of words and driver edges kept, unless the line keeps everything.
const KEPT_EVENTS: usize = 65_536;

/// A stretch of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// Its first instant.
    pub start: Time,
    /// The first instant after it.
    pub end: Time,
}

/// The bus, the master at its other end, and a listener that records what is said.
#[derive(Clone, Debug)]
pub struct Line {
    settings: Settings,
    master: Master,
    /// Low where noise turns the bus over.
    noise: Wave,
    /// The TX pin as USART1 drives it.
    usart: Wave,
    last_sent: Option<Span>,
    tx_pin: TxPin,
    driver: bool,
    echo: bool,
    follow: bool,
    /// What the unit's driver puts on the bus; high while it is off.
    unit: Wave,
    bus: Wave,
    /// The level of the unit's RX pin, and its edges that the USART has not received yet.
    rx: bool,
    rx_edges: Vec<(Time, bool)>,
    listener: Receiver,
    record: Record,
    received: VecDeque<Received>,
    driver_edges: VecDeque<(Time, bool)>,
    collisions: VecDeque<Span>,
    findings: Vec<(Time, &'static str)>,
    keep_all: bool,
    /// What it has to do with the other units of a bus.
    shared: Shared,
    /// Everything up to here has happened.
    now: Time,
}

impl Default for Line {
    /// An idle bus with a master at 9600 8N2.
    fn default() -> Self {
        Self {
            settings: Settings::default(),
            master: Master::default(),
            noise: Wave::default(),
            usart: Wave::default(),
            last_sent: None,
            tx_pin: TxPin::Level(true),
            driver: false,
            echo: false,
            follow: false,
            unit: Wave::default(),
            bus: Wave::default(),
            rx: true,
            rx_edges: Vec::new(),
            listener: Receiver::default(),
            record: Record::default(),
            received: VecDeque::new(),
            driver_edges: VecDeque::new(),
            collisions: VecDeque::new(),
            findings: Vec::new(),
            keep_all: false,
            shared: Shared::default(),
            now: Time::ZERO,
        }
    }
}

impl Line {
    /// The master's settings, by which the line is recorded too.
    #[must_use]
    pub const fn settings(&self) -> Settings {
        self.settings
    }

    /// Sets the master's rate and format. What it has queued goes out as it was queued.
    pub fn set_settings(&mut self, settings: Settings) {
        self.settings = settings;
    }

    /// Whether the master takes over the unit's rate and format whenever it has nothing left to
    /// send: for a line whose master has no settings, such as a pseudo-terminal.
    pub fn set_follow(&mut self, follow: bool) {
        self.follow = follow;
    }

    /// Keeps every frame, word, driver edge and collision from now on, for a test that reads them all.
    /// Otherwise the last [`KEPT`] frames and 65 536 of the others stay.
    pub fn set_keep_all(&mut self, all: bool) {
        self.keep_all = all;
        self.record.set_keep_all(all);
    }

    /// The complete frames kept, oldest first.
    pub fn frames(&self) -> impl DoubleEndedIterator<Item = &Frame> {
        self.record.frames()
    }

    /// The complete frames kept whose number is above `number`, oldest first.
    pub fn frames_since(&self, number: u64) -> impl Iterator<Item = &Frame> {
        self.record.since(number)
    }

    /// How many frames the master, and the unit, have sent so far.
    #[must_use]
    pub fn frame_counts(&self) -> (u64, u64) {
        self.record.counts()
    }

    /// Each switching of the unit's driver, and whether it was on after it; on a bus with several units, whether any
    /// unit's driver was on.
    pub fn driver_edges(&self) -> impl DoubleEndedIterator<Item = (Time, bool)> + '_ {
        self.driver_edges.iter().copied()
    }

    /// When the master was sending while a unit's driver was on, or the drivers of two units were on.
    pub fn collisions(&self) -> impl DoubleEndedIterator<Item = Span> + '_ {
        self.collisions.iter().copied()
    }

    /// The bus level at `at`, from [`HISTORY`] ago to now.
    #[must_use]
    pub fn level_at(&self, at: Time) -> bool {
        self.bus.level_at(at)
    }

    /// The falling edges of the bus after `from` up to and including `to`, within [`HISTORY`].
    pub fn falling_edges(&self, from: Time, to: Time) -> impl Iterator<Item = Time> + '_ {
        self.bus
            .edges(from, to)
            .filter(|&(_, level)| !level)
            .map(|(at, _)| at)
    }

    /// What the unit did that damages its own messages, since the last call: bytes lost because the
    /// driver was off, a driver switched off too early.
    pub fn take_findings(&mut self) -> Vec<(Time, &'static str)> {
        std::mem::take(&mut self.findings)
    }

    /// The line has been followed up to this instant.
    #[must_use]
    pub const fn now(&self) -> Time {
        self.now
    }
}

/// Appends to a list that forgets its oldest entries beyond [`KEPT_EVENTS`], unless all are wanted.
fn keep<T>(list: &mut VecDeque<T>, entry: T, all: bool) {
    // Before the push, so that a full list does not allocate twice its length.
    if !all && list.len() >= KEPT_EVENTS {
        list.pop_front();
    }
    list.push_back(entry);
}
