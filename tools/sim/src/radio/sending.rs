//! The sending side of a module: collects the bytes of its UART into packets (manual 6.2).

use std::collections::VecDeque;

use super::timing;
use f103::time::Time;

/// Bytes on their way from the UART to the air.
#[derive(Clone, Debug, Default)]
pub(super) struct Sending {
    /// Bytes that are in no packet yet.
    buffer: VecDeque<u8>,
    /// Time at which the UART has been silent for three byte times.
    silent_at: Time,
    /// End of the packet that is being sent.
    on_air: Option<Time>,
    /// The next packet cannot begin before this instant.
    free_at: Time,
}

impl Sending {
    /// Takes a byte from the UART; it is lost if the buffer is full. The UART is silent at `silent_at` if no other byte
    /// follows.
    pub(super) fn put(&mut self, byte: u8, silent_at: Time) {
        self.silent_at = silent_at;
        if self.buffer.len() < timing::BUFFER_BYTES {
            self.buffer.push_back(byte);
        }
    }

    /// Returns whether all bytes are in packets that have begun.
    pub(super) fn is_empty(&self) -> bool {
        self.buffer.is_empty()
    }

    /// Returns whether a packet is being sent.
    pub(super) const fn is_on_air(&self) -> bool {
        self.on_air.is_some()
    }

    /// Returns the instant at which a packet ends or begins. `idle` says that no character is being received.
    pub(super) fn next_event(&self, idle: bool) -> Option<Time> {
        if self.on_air.is_some() {
            return self.on_air;
        }
        if self.buffer.len() >= timing::PACKET_BYTES {
            return Some(self.free_at);
        }
        let waits = idle && !self.buffer.is_empty();
        waits.then(|| self.free_at.max(self.silent_at))
    }

    /// Ends the packet that is being sent, if it has ended by `now`. Returns the instant from which on the radio can
    /// receive.
    pub(super) fn end(&mut self, now: Time) -> Option<Time> {
        let end = self.on_air.take_if(|end| *end <= now)?;
        self.free_at = end + timing::TURNAROUND;
        Some(self.free_at)
    }

    /// Returns the bytes of the packet that begins now; `None` if none begins. `idle` says that no character is being
    /// received. Call [`begin`](Self::begin) with the end of the packet.
    pub(super) fn next_packet(&mut self, idle: bool, now: Time) -> Option<Vec<u8>> {
        let due = self.on_air.is_none() && self.next_event(idle).is_some_and(|at| at <= now);
        let length = self.buffer.len().min(timing::PACKET_BYTES);
        due.then(|| self.buffer.drain(..length).collect())
    }

    /// Notes that a packet is being sent until `end`.
    pub(super) fn begin(&mut self, end: Time) {
        self.on_air = Some(end);
    }

    /// Drops everything, as without power. Returns whether this has cut a packet.
    pub(super) fn cut(&mut self) -> bool {
        let cut = self.on_air.is_some();
        *self = Self::default();
        cut
    }
}
