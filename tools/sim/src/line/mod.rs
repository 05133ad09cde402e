//! The RS-485 bus between the board and its master.
//!
//! The master, the unit's driver and noise each are a level over time. The bus is low when the master or the unit pulls
//! it low: a wired AND, as a receiver sees two drivers at the same time. Noise inverts the bus. Each receiver samples
//! the level of the bus at its own rate. So a wrong rate, a wrong parity, a break, a cut character or a collision has
//! the same effect as on a wire.
//!
//! ```text
//! master --- wave --+
//!                   AND -- XOR -- bus --+-- the unit's receiver (off while its driver is on)
//! USART1 - driver --+       |           +-- the recording receiver: received(), frames
//! other units ------+     noise
//! ```
//!
//! Several boards share a bus in [`crate::bus`]. Each board then has its own end of the line, and one more [`Line`] is
//! the bus, with the master and the record.

mod frames;
mod master;
mod shared;
mod silence;
mod wiring;

#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use f103::periph::usart::TxPin;
pub use f103::serial::{Character, Format, Parity, Rate, Settings};
use f103::serial::{Receiver, Wave};
use f103::time::Time;
pub use frames::{Frame, KEPT, LONGEST, Record};
use master::Master;
pub use master::Received;
pub use modbus_line::Direction;
pub(crate) use shared::Output;
use shared::Shared;
pub use silence::frame_silence;

/// How far back [`Line::level_at`] knows the level of the bus.
pub const HISTORY: Time = Time::from_ms(100);

/// Number of words and driver edges kept, unless the line keeps everything.
const KEPT_EVENTS: usize = 65_536;

/// A span of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    /// First instant of the span.
    pub start: Time,
    /// First instant after the span.
    pub end: Time,
}

/// The bus, the master at its other end, and a receiver that records the frames.
#[derive(Clone, Debug)]
pub struct Line {
    settings: Settings,
    master: Master,
    /// Low while noise inverts the bus.
    noise: Wave,
    /// The TX pin as the unit's USART drives it.
    usart: Wave,
    last_sent: Option<Span>,
    /// A character that has begun, or begins soon, and that the driver or the TX pin keeps from the bus so far.
    unheard: Option<Character>,
    tx_pin: TxPin,
    driver: bool,
    echo: bool,
    follow: bool,
    /// Level that the unit's driver puts on the bus; high while the driver is off.
    unit: Wave,
    bus: Wave,
    /// Level of the unit's RX pin.
    rx: bool,
    /// Edges of the RX pin that the USART has not taken yet.
    rx_edges: Vec<(Time, bool)>,
    listener: Receiver,
    record: Record,
    received: VecDeque<Received>,
    driver_edges: VecDeque<(Time, bool)>,
    collisions: VecDeque<Span>,
    findings: Vec<(Time, &'static str)>,
    /// The other units on a bus with several units.
    shared: Shared,
    /// The line is computed up to this instant.
    now: Time,
}

impl Default for Line {
    /// Returns an idle bus with a master at 9600 8N2.
    fn default() -> Self {
        Self {
            settings: Settings::default(),
            master: Master::default(),
            noise: Wave::default(),
            usart: Wave::default(),
            last_sent: None,
            unheard: None,
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
            shared: Shared::default(),
            now: Time::ZERO,
        }
    }
}

impl Line {
    /// Returns the rate and format of the master. The record receives with them, too.
    #[must_use]
    pub const fn settings(&self) -> Settings {
        self.settings
    }

    /// Sets the master's rate and format. Characters that are already queued keep theirs.
    pub fn set_settings(&mut self, settings: Settings) {
        self.settings = settings;
    }

    /// Chooses whether the master takes over the unit's rate and format whenever it has nothing to send. This is for a
    /// master without settings, such as the client of a socket.
    pub fn set_follow(&mut self, follow: bool) {
        self.follow = follow;
    }

    /// Returns the complete frames that are kept, oldest first.
    pub fn frames(&self) -> impl DoubleEndedIterator<Item = &Frame> {
        self.record.frames()
    }

    /// Returns the complete frames that are kept and have numbers above `number`, oldest first.
    pub fn frames_since(&self, number: u64) -> impl Iterator<Item = &Frame> {
        self.record.since(number)
    }

    /// Returns the number of frames so far: from the master, and from units.
    #[must_use]
    pub fn frame_counts(&self) -> (u64, u64) {
        self.record.counts()
    }

    /// Returns the instants at which the unit's driver was switched, and whether it was on afterwards. On a bus with
    /// several units: whether the driver of any unit was on afterwards.
    pub fn driver_edges(&self) -> impl DoubleEndedIterator<Item = (Time, bool)> + '_ {
        self.driver_edges.iter().copied()
    }

    /// Spans in which the master was sending while a unit's driver was on, or in which the drivers of two units were
    /// on.
    pub fn collisions(&self) -> impl DoubleEndedIterator<Item = Span> + '_ {
        self.collisions.iter().copied()
    }

    /// Returns the level of the bus at `at`, which must be between [`HISTORY`] ago and now.
    #[must_use]
    pub fn level_at(&self, at: Time) -> bool {
        self.bus.level_at(at)
    }

    /// Returns the falling edges of the bus after `from`, up to and including `to`. Both must be within [`HISTORY`].
    pub fn falling_edges(&self, from: Time, to: Time) -> impl Iterator<Item = Time> + '_ {
        self.bus
            .edges(from, to)
            .filter(|&(_, level)| !level)
            .map(|(at, _)| at)
    }

    /// Returns the actions of the unit since the last call that damage its own characters, such as a driver that is
    /// switched off too early.
    pub fn take_findings(&mut self) -> Vec<(Time, &'static str)> {
        std::mem::take(&mut self.findings)
    }

    /// Returns the instant up to which the line is computed.
    #[must_use]
    pub const fn now(&self) -> Time {
        self.now
    }
}

/// Appends to a list. Removes the oldest entry of a list with [`KEPT_EVENTS`] entries.
fn keep<T>(list: &mut VecDeque<T>, entry: T) {
    // Remove before the push, so that a full list does not allocate twice its length.
    if list.len() >= KEPT_EVENTS {
        list.pop_front();
    }
    list.push_back(entry);
}
