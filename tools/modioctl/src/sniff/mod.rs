//! Finds the frames in the bytes that a listener receives from a Modbus line.
//!
//! A listener receives requests and responses in one stream of bytes. On an RTU line, silence marks the end of a frame,
//! but USB adapters deliver bytes in batches, 16 ms apart and more: the silences are lost. [`Splitter`] therefore finds
//! frames by their content: by the lengths that a function allows, and by the CRC.

mod kind;
mod splitter;

use std::time::Duration;

use crate::bus::Direction;

pub use splitter::Splitter;

/// A frame, or bytes that belong to no frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    /// What the bytes are.
    pub kind: Kind,
    /// The bytes as received.
    pub bytes: Vec<u8>,
    /// Time from the start of the recording to the beginning of the first byte.
    pub from: Duration,
    /// Time from the start of the recording to the end of the last byte.
    pub until: Duration,
}

/// Kind of a piece.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A frame with a correct check.
    Frame {
        direction: Direction,
        unit: u8,
        pdu: Vec<u8>,
        /// For a response: the request that it answers, if the listener received that request.
        request: Option<Request>,
    },
    /// Bytes that are not a frame: noise, a collision, a wrong rate or a wrong format.
    Garbled,
}

/// A request that a unit has not answered yet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// The address of the unit.
    pub unit: u8,
    /// The PDU.
    pub pdu: Vec<u8>,
    /// Time from the start of the recording to the end of the last byte.
    pub until: Duration,
}

impl Piece {
    /// Returns the time from the end of the request to the beginning of its response.
    pub fn turnaround(&self) -> Option<Duration> {
        match &self.kind {
            Kind::Frame {
                request: Some(request),
                ..
            } => Some(self.from.saturating_sub(request.until)),
            _ => None,
        }
    }
}
