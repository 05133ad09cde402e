//! Splits a stream of bytes into frames.

use std::collections::VecDeque;
use std::time::Duration;

use super::kind::{Length, SHORTEST, asked, direction, lengths};
use super::{Kind, Piece, Request};
use crate::bus::Direction;
use crate::bus::adu::{ASCII_MOST, Framing, RTU_MOST};

#[derive(Debug, PartialEq, Eq)]
enum Front {
    Frame(usize),
    /// This many bytes that belong to no frame.
    Garbled(usize),
    Unknown,
}

/// Splits the bytes of a line into frames and garbled bytes. No byte is lost or repeated.
#[derive(Debug)]
pub struct Splitter {
    framing: Framing,
    /// Duration of one character on the line.
    character: Duration,
    /// Longest time from a request to its response.
    patience: Duration,
    bytes: Vec<u8>,
    /// The end of each byte of `bytes`.
    times: VecDeque<Duration>,
    /// Time when the last chunk was received.
    received: Duration,
    garbled: Option<Piece>,
    open: Option<Request>,
}

impl Splitter {
    /// Returns a splitter for a line. `character` is the time of one character, zero when the times of the bytes within
    /// a chunk are unknown. A response can start up to `patience` after its request.
    pub fn new(framing: Framing, character: Duration, patience: Duration) -> Self {
        Self {
            framing,
            character,
            patience,
            bytes: Vec::new(),
            times: VecDeque::new(),
            received: Duration::ZERO,
            garbled: None,
            open: None,
        }
    }

    /// Returns whether no bytes wait for the rest of their frame.
    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty() && self.garbled.is_none()
    }

    /// Takes the bytes that were received at `at`, and returns the pieces that are complete.
    pub fn push(&mut self, bytes: &[u8], at: Duration) -> Vec<Piece> {
        for after in (0..bytes.len()).rev() {
            let after = u32::try_from(after).unwrap_or(u32::MAX);
            let end = at.saturating_sub(self.character.saturating_mul(after));
            // A byte of this chunk was not received before the last byte of the previous chunk.
            self.times.push_back(end.max(self.received));
        }
        self.received = at.max(self.received);
        self.bytes.extend(bytes);
        self.split(false)
    }

    /// Returns the remaining bytes after a silence. Later bytes do not belong to them.
    pub fn flush(&mut self) -> Vec<Piece> {
        self.split(true)
    }

    fn split(&mut self, silence: bool) -> Vec<Piece> {
        let mut pieces = Vec::new();
        while !self.bytes.is_empty() {
            match self.front(silence) {
                Front::Unknown => break,
                Front::Garbled(length) => self.take_garbled(length),
                Front::Frame(length) => {
                    pieces.extend(self.garbled.take());
                    pieces.push(self.take_frame(length));
                }
            }
        }
        // Garbled bytes are collected up to the length of the longest frame, because one piece is easier to read
        // than many.
        let long = |piece: &Piece| piece.bytes.len() >= RTU_MOST;
        if silence || self.garbled.as_ref().is_some_and(long) {
            pieces.extend(self.garbled.take());
        }
        pieces
    }

    fn front(&self, silence: bool) -> Front {
        match self.framing {
            Framing::Ascii => self.ascii_front(silence),
            Framing::Rtu | Framing::Mbap => self.rtu_front(silence),
        }
    }

    fn rtu_front(&self, silence: bool) -> Front {
        let unit = self.bytes.first().copied().unwrap_or_default();
        let function = self.bytes.get(1).copied().unwrap_or_default();
        let open = self.asked(unit, function);
        let mut incomplete = false;
        let mut found = Vec::new();
        for length in lengths(&self.bytes, open) {
            match length {
                Length::Known(length) if self.is_frame(length) => found.push(length),
                Length::Known(length) => {
                    incomplete |= length > self.bytes.len() && length <= RTU_MOST;
                }
                Length::Later => incomplete = true,
            }
        }
        if let Some(length) = found.into_iter().min() {
            return Front::Frame(length);
        }
        if incomplete && !silence {
            return Front::Unknown;
        }
        self.unknown_function(silence).unwrap_or(Front::Garbled(1))
    }

    /// Looks for a frame with a function of unknown length: at the beginning of the received bytes or directly
    /// after a frame, the shortest run of bytes with a correct CRC is used. Elsewhere noise would often contain
    /// one.
    fn unknown_function(&self, silence: bool) -> Option<Front> {
        let [unit, function, ..] = self.bytes[..] else {
            return None;
        };
        let known = modbus_line::names::function(function).is_some() && function & 0x7F != 0x2B;
        let valid = !known && unit <= 247 && function & 0x7F != 0;
        if self.garbled.is_some() || !valid {
            return None;
        }
        let most = self.bytes.len().min(RTU_MOST);
        match (SHORTEST..=most).find(|length| self.is_frame(*length)) {
            Some(length) => Some(Front::Frame(length)),
            None if silence || self.bytes.len() >= RTU_MOST => None,
            None => Some(Front::Unknown),
        }
    }

    fn ascii_front(&self, silence: bool) -> Front {
        let start = self.bytes.iter().position(|byte| *byte == b':');
        match start {
            None => return Front::Garbled(self.bytes.len()),
            Some(0) => {}
            Some(start) => return Front::Garbled(start),
        }
        let rest = self.bytes.get(1..).unwrap_or_default();
        let again = rest.iter().position(|byte| *byte == b':').map(|at| at + 1);
        match (self.framing.length(&self.bytes), again) {
            (Some(end), again) if again.is_none_or(|again| again >= end) => {
                if self.is_frame(end) {
                    Front::Frame(end)
                } else {
                    Front::Garbled(end)
                }
            }
            // A colon starts a new frame, so the previous frame is incomplete.
            (_, Some(again)) => Front::Garbled(again),
            (_, None) if silence || self.bytes.len() > ASCII_MOST => {
                Front::Garbled(self.bytes.len())
            }
            (_, None) => Front::Unknown,
        }
    }

    fn is_frame(&self, length: usize) -> bool {
        let frame = self.bytes.get(..length);
        frame.is_some_and(|frame| self.framing.open(frame).is_some())
    }

    fn asked(&self, unit: u8, function: u8) -> Option<&Request> {
        let from = self.start();
        asked(self.open.as_ref(), unit, function, from, self.patience)
    }

    /// Returns the time when the first byte of the buffer began.
    fn start(&self) -> Duration {
        let end = self.times.front().copied().unwrap_or(self.received);
        end.saturating_sub(self.character)
    }

    fn take(&mut self, length: usize, kind: Kind) -> Piece {
        let from = self.start();
        let length = length.clamp(1, self.bytes.len().max(1));
        let until = self.times.drain(..length.min(self.times.len())).next_back();
        Piece {
            kind,
            bytes: self.bytes.drain(..length.min(self.bytes.len())).collect(),
            from,
            until: until.unwrap_or(from),
        }
    }

    fn take_garbled(&mut self, length: usize) {
        let more = self.take(length, Kind::Garbled);
        match &mut self.garbled {
            Some(piece) => {
                piece.bytes.extend(more.bytes);
                piece.until = more.until;
            }
            none => *none = Some(more),
        }
    }

    fn take_frame(&mut self, length: usize) -> Piece {
        let frame = self.bytes.get(..length).unwrap_or_default();
        let (unit, pdu) = self.framing.open(frame).unwrap_or_default();
        let function = pdu.first().copied().unwrap_or_default();
        let open = self.asked(unit, function).cloned();
        let direction = direction(unit, &pdu, open.as_ref());
        let request = open.filter(|_| direction == Direction::Response);
        let kind = Kind::Frame {
            direction,
            unit,
            pdu: pdu.clone(),
            request,
        };
        let piece = self.take(length, kind);
        // No unit answers a broadcast.
        self.open = (direction == Direction::Request && unit != 0).then_some(Request {
            unit,
            pdu,
            until: piece.until,
        });
        piece
    }
}

#[cfg(test)]
#[path = "splitter_tests.rs"]
mod tests;
