//! The reference's ear: collects what it hears, judges it at the end.

use super::reference::{GAPS, Reference, judge_ascii};
use super::{Points, crc};
use modbus_server::line::Framing;

/// A whole unit on a line.
pub struct Ear {
    pub server: Reference,
    strict: bool,
    heard: Vec<u8>,
    /// In ASCII mode: a colon has come, and not the end.
    inside: bool,
    faulty: bool,
    overrun: bool,
    paused: bool,
    torn: bool,
}

impl Ear {
    pub fn new(framing: Framing, points: Points, strict: bool) -> Self {
        Self {
            server: Reference::new(framing, points),
            strict,
            heard: Vec::new(),
            inside: false,
            faulty: false,
            overrun: false,
            paused: false,
            torn: false,
        }
    }

    /// A character, with faults as in `Faults`, of which noise (4) does not count. The reply to an ASCII frame that it ended.
    pub fn character(&mut self, byte: u8, faults: u8) -> Option<Vec<u8>> {
        let faults = faults & 11;
        match self.server.framing {
            Framing::Ascii { delimiter } => {
                if byte == b':' && (!self.inside || faults == 0) {
                    self.finish();
                    self.inside = true;
                } else if !self.inside {
                    return None;
                } else {
                    self.heard.push(byte);
                }
                let ends = self.heard.ends_with(&[b'\r', delimiter]);
                self.note(faults);
                ends.then(|| self.finish()).flatten()
            }
            Framing::Rtu => {
                if self.paused {
                    self.server.counters[GAPS] += 1;
                    self.torn = true;
                }
                self.paused = false;
                self.inside = true;
                self.heard.push(byte);
                self.note(faults);
                None
            }
        }
    }

    fn note(&mut self, faults: u8) {
        self.faulty |= faults != 0;
        self.overrun |= faults & 8 != 0;
    }

    pub fn pause(&mut self) {
        self.paused = self.inside && self.server.framing == Framing::Rtu;
    }

    /// The reply to what was heard before this silence.
    pub fn silence(&mut self) -> Option<Vec<u8>> {
        self.finish()
    }

    fn finish(&mut self) -> Option<Vec<u8>> {
        let heard = std::mem::take(&mut self.heard);
        let inside = std::mem::take(&mut self.inside);
        let faulty = std::mem::take(&mut self.faulty);
        let overrun = std::mem::take(&mut self.overrun);
        let torn = std::mem::take(&mut self.torn);
        self.paused = false;
        if !inside {
            return None;
        }
        let good = match self.server.framing {
            Framing::Rtu => judge_rtu(&heard),
            Framing::Ascii { delimiter } => heard
                .strip_suffix(&[b'\r', delimiter])
                .and_then(judge_ascii),
        };
        match good {
            Some(good) if !faulty => self.server.good(good[0], &good[1..], torn && self.strict),
            _ => {
                self.server.bad(overrun);
                None
            }
        }
    }
}

fn judge_rtu(heard: &[u8]) -> Option<Vec<u8>> {
    if !(4..=256).contains(&heard.len()) {
        return None;
    }
    let (body, check) = heard.split_at(heard.len() - 2);
    (crc(body) == check).then(|| body.to_vec())
}
