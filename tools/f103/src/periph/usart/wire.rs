//! The wire at the pins of a USART, and the exchange that advances both in time together.

use super::{Sent, Usart};
use crate::periph::gpio::Drive;
use crate::peripheral::Peripheral;
use crate::serial::Rate;
use crate::time::Time;

/// Who drives the TX pin of a USART.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TxPin {
    /// The USART: the pin is an alternate function output.
    Usart,
    /// The pin stands at this level: a plain output, or an input pulled one way. A floating input counts as high.
    Level(bool),
}

/// What is connected to the TX and RX pins of a USART.
pub trait Wire {
    /// The USART did something to its TX pin. A character is passed when its start bit begins.
    fn sent(&mut self, _sent: Sent) {}

    /// Sets how the TX pin is driven from `now` on.
    fn set_tx_pin(&mut self, _pin: TxPin, _now: Time) {}

    /// Advances the wire to `to`.
    fn advance(&mut self, to: Time);

    /// Returns the instant of the last [`Wire::advance`].
    fn now(&self) -> Time;

    /// Takes the edges at the RX pin that have happened since the last call: when, and the level after each.
    fn take_edges(&mut self) -> Vec<(Time, bool)> {
        Vec::new()
    }

    /// Returns the instant of the next edge at the RX pin, as far as it is known. An edge that has happened and was not
    /// taken counts as one at [`Wire::now`].
    fn next_edge(&self) -> Option<Time> {
        None
    }

    /// Returns whether an edge at the RX pin has happened that was not taken.
    fn has_edges(&self) -> bool {
        false
    }

    /// Returns the level at the RX pin.
    fn rx_level(&self) -> bool {
        true
    }

    /// Returns how the device drives the RX pin.
    fn rx_drive(&self) -> Drive {
        match self.rx_level() {
            true => Drive::High,
            false => Drive::Low,
        }
    }

    /// Returns the instant of the next event of the device, other than an edge at the RX pin: the wire has to be
    /// advanced to it. It is not before the last [`Wire::advance`].
    fn next_event(&self) -> Option<Time> {
        None
    }

    /// Called when the wire and its USART have reached the same instant.
    fn caught_up(&mut self, _usart: &Usart) {}
}

impl Usart {
    /// Runs the USART and its wire up to `now`, in order; this replaces [`Peripheral::advance`]. Call it before each
    /// access, before the pins change, and at each event.
    pub fn exchange(&mut self, wire: &mut dyn Wire, now: Time) {
        self.pass_sent(wire);
        loop {
            // A stalled core lets more than one event pass: take them one by one.
            let due = self.next_event().filter(|&due| due > wire.now());
            let to = due.unwrap_or(now).min(now).max(wire.now());
            wire.advance(to);
            for (at, level) in wire.take_edges() {
                self.receive_edge(at, level);
            }
            self.advance(to);
            self.pass_sent(wire);
            if to >= now {
                break;
            }
        }
        wire.caught_up(self);
    }

    /// Passes what was sent on to the wire. Call it after each access, so that the wire knows its next event.
    pub fn pass_sent(&mut self, wire: &mut dyn Wire) {
        for sent in self.take_sent() {
            wire.sent(sent);
        }
    }

    /// Returns the next instant at which something happens in the USART, caused by the USART or by its wire.
    #[must_use]
    pub fn next_exchange(&self, wire: &dyn Wire) -> Option<Time> {
        let listens = self.awaits_start() || wire.has_edges();
        let edge = wire.next_edge().filter(|_| listens);
        [self.next_event(), edge, wire.next_event()]
            .into_iter()
            .flatten()
            .min()
    }

    /// Returns whether the transmitter has sent something that was not passed to its wire yet.
    #[must_use]
    pub fn has_sent(&self) -> bool {
        self.tx.has_sent()
    }

    /// Returns the length of a bit that it sends; `None` while the transmitter is off.
    #[must_use]
    pub fn bit(&self) -> Option<Time> {
        let shape = self.shape()?;
        Some(Rate::from_clock(shape.bit_cycles, shape.hz).bits(1))
    }

    /// Returns the earliest instant at which a character can begin that has not begun, if the core does nothing before
    /// `now` but may do anything then: the end of what is under way, or else a tick of the baud generator. `None` while
    /// the transmitter is off: then an idle frame comes first.
    #[must_use]
    pub fn earliest_start(&self, now: Time) -> Option<Time> {
        let shape = self.shape()?;
        let under_way = self.tx.shift_end().filter(|&end| end >= now);
        under_way.or_else(|| {
            let rate = Rate::from_clock(shape.bit_cycles, shape.hz);
            let after = now + Time::from_ps(1);
            let (_, tick) = rate.ticks(1, after.saturating_sub(shape.since));
            Some(shape.since + tick)
        })
    }

    /// Takes the edges at the RX pin since the last call, for a timer that captures the same pin: of the falling
    /// and of the rising ones the last two, which is all that a timer's registers can show.
    pub fn take_edges(&mut self) -> Vec<(Time, bool)> {
        let mut edges: Vec<_> = std::mem::take(&mut self.last_edges)
            .into_iter()
            .zip([false, true])
            .flat_map(|(times, rising)| times.into_iter().flatten().map(move |at| (at, rising)))
            .collect();
        edges.sort_unstable();
        edges
    }
}
