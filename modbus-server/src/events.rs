//! The communication event log: the last 64 events, newest first (V1.1b3 6.10).

use crate::{Adu, Exception};

/// An event byte. [`Event::received`] and [`Event::sent`] are sums of bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Event(u8);

impl Event {
    /// Communication was restarted.
    pub(crate) const RESTARTED: Self = Self(0x00);
    /// The unit entered listen-only mode.
    pub(crate) const LISTEN_ONLY: Self = Self(0x04);

    const RECEIVE: u8 = 1 << 7;
    const COMMUNICATION_ERROR: u8 = 1 << 1;
    const OVERRUN: u8 = 1 << 4;
    const BROADCAST: u8 = 1 << 6;

    const SEND: u8 = 1 << 6;

    /// Bit of receive and send events: the unit is in listen-only mode.
    const LISTENING: u8 = 1 << 5;

    /// Event: a request for this unit was received.
    pub(crate) const fn received(broadcast: bool, listening: bool) -> Self {
        let broadcast = if broadcast { Self::BROADCAST } else { 0 };
        Self(Self::RECEIVE | broadcast | Self::listening(listening))
    }

    /// Event: an invalid frame was received.
    pub(crate) const fn faulty(overrun: bool, listening: bool) -> Self {
        let overrun = if overrun { Self::OVERRUN } else { 0 };
        Self(Self::RECEIVE | Self::COMMUNICATION_ERROR | overrun | Self::listening(listening))
    }

    /// Event: a request was served, with this exception, if any.
    pub(crate) const fn sent(exception: Option<Exception>, listening: bool) -> Self {
        let exception = match exception {
            // The standard has a bit for exceptions 01 to 07 only.
            None
            | Some(
                Exception::MemoryParityError
                | Exception::GatewayPathUnavailable
                | Exception::GatewayTargetDeviceFailedToRespond,
            ) => 0,
            Some(
                Exception::IllegalFunction
                | Exception::IllegalDataAddress
                | Exception::IllegalDataValue,
            ) => 1 << 0,
            Some(Exception::ServerDeviceFailure) => 1 << 1,
            Some(Exception::Acknowledge | Exception::ServerDeviceBusy) => 1 << 2,
            Some(Exception::NegativeAcknowledge) => 1 << 3,
        };
        Self(Self::SEND | exception | Self::listening(listening))
    }

    const fn listening(listening: bool) -> u8 {
        if listening { Self::LISTENING } else { 0 }
    }
}

/// The last 64 events.
#[derive(Debug)]
pub(crate) struct EventLog {
    events: [u8; EventLog::CAPACITY],
    /// Number of events so far. Once the log is full, this number modulo `CAPACITY`, plus `CAPACITY`. The next
    /// event is stored at this number modulo `CAPACITY`.
    added: u8,
}

impl EventLog {
    /// Number of events in the log, as in the standard.
    pub(crate) const CAPACITY: usize = 64;

    pub(crate) const fn new() -> Self {
        Self {
            events: [0; Self::CAPACITY],
            added: 0,
        }
    }

    /// Adds an event. When the log is full, it replaces the oldest.
    pub(crate) fn push(&mut self, Event(event): Event) {
        // The index is always in range, so the compiler removes this check.
        let at = usize::from(self.added) % Self::CAPACITY;
        if let Some(slot) = self.events.get_mut(at) {
            *slot = event;
        }
        self.added += 1;
        if usize::from(self.added) == 2 * Self::CAPACITY {
            self.added = Self::CAPACITY as u8;
        }
    }

    /// Discards all events.
    pub(crate) const fn clear(&mut self) {
        self.added = 0;
    }

    /// Returns the number of events.
    pub(crate) const fn count(&self) -> u8 {
        let full = Self::CAPACITY as u8;
        if self.added < full { self.added } else { full }
    }

    /// Appends the events to a reply, newest first.
    pub(crate) fn append_to(&self, adu: &mut Adu) {
        for newer in 0..self.count() {
            let at = self.added.wrapping_sub(newer + 1) % Self::CAPACITY as u8;
            let event = self.events.get(usize::from(at)).copied();
            adu.extend(&[event.unwrap_or_default()]);
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    fn listed(log: &EventLog) -> Vec<u8> {
        let mut adu = Adu::new();
        log.append_to(&mut adu);
        adu.as_slice().to_vec()
    }

    #[test]
    fn the_newest_event_is_first_and_the_65th_replaces_the_oldest() {
        let mut log = EventLog::new();
        assert_eq!(listed(&log), []);
        for n in 1..=200_u8 {
            log.push(Event(n));
            let expected: Vec<u8> = (1..=n).rev().take(64).collect();
            assert_eq!(listed(&log), expected);
            assert_eq!(usize::from(log.count()), expected.len());
        }
        log.clear();
        log.push(Event(7));
        assert_eq!(listed(&log), [7]);
    }

    #[test]
    fn events_have_the_bits_of_the_standard() {
        assert_eq!(Event::received(false, false), Event(0x80));
        assert_eq!(Event::received(true, true), Event(0xE0));
        assert_eq!(Event::faulty(false, false), Event(0x82));
        assert_eq!(Event::faulty(true, true), Event(0xB2));
        assert_eq!(Event::sent(None, true), Event(0x60));
        for (exception, event) in [
            (Exception::IllegalFunction, 0x41),
            (Exception::IllegalDataAddress, 0x41),
            (Exception::IllegalDataValue, 0x41),
            (Exception::ServerDeviceFailure, 0x42),
            (Exception::Acknowledge, 0x44),
            (Exception::ServerDeviceBusy, 0x44),
            (Exception::NegativeAcknowledge, 0x48),
            (Exception::MemoryParityError, 0x40),
            (Exception::GatewayPathUnavailable, 0x40),
            (Exception::GatewayTargetDeviceFailedToRespond, 0x40),
        ] {
            assert_eq!(Event::sent(Some(exception), false), Event(event));
        }
    }
}
