//! The reference server on a line: framing, addresses and the times of replies.

use std::collections::VecDeque;
use std::time::Duration;

use conformance::endpoint::Received;
use conformance::frame::Mode;

use modbus_line::{LineFormat, fast};
use modbus_reference::server::{BUS, ERRORS};
use modbus_reference::{Server as Reference, crc, framed, lrc};

use super::fast::Fast;
use super::fault::Fault;
use super::modio::{self, Modio};
use super::modio_fault::ModioFault;
use super::server::{Server, reference};

/// The unit's address when it is not a modio.
const UNIT: u8 = 9;

/// Time from the end of the silence to the reply.
const THINKING: Duration = Duration::from_micros(40);

/// A character on the line.
#[derive(Clone, Copy, Debug)]
pub struct Character {
    pub byte: u8,
    pub start: Duration,
    pub end: Duration,
    pub parity_error: bool,
    pub stop_error: bool,
}

/// The unit.
pub struct Unit {
    pub server: Server,
    pub reference: Reference,
    pub address: u8,
    pub mode: Mode,
    pub line: LineFormat,
    /// Rate and format of the master. The unit receives only when they are those of its line.
    pub master: LineFormat,
    /// Counts characters of the line's format for t1.5 and t3.5, not characters of 11 bits.
    pub own_characters: bool,
    /// Is silent to a write whose byte count differs from the number of data bytes.
    pub silent_to_incomplete_writes: bool,
    /// Characters of replies, and the edges of the driver.
    pub sent: VecDeque<Received>,
    pub edges: Vec<(Duration, bool)>,
    pub echo: bool,
    pub fast: Fast,
    open: Vec<u8>,
    damaged: bool,
    late: bool,
    /// The frame had a gap above t1.5.
    sparse: bool,
    last: Option<Duration>,
    /// There has been no silence since power-on.
    waiting: bool,
    deaf: bool,
    reply_end: Duration,
    /// There were characters in front of an ASCII frame.
    colon_spoilt: bool,
    dead: bool,
}

impl Unit {
    pub fn new(fault: Option<Fault>, mode: Mode, line: LineFormat) -> Self {
        Self {
            server: Server { fault, modio: None },
            reference: reference((mode == Mode::Ascii).then_some(b'\n')),
            address: UNIT,
            mode,
            line,
            master: line,
            own_characters: false,
            silent_to_incomplete_writes: false,
            sent: VecDeque::new(),
            edges: Vec::new(),
            echo: false,
            fast: Fast::default(),
            open: Vec::new(),
            damaged: false,
            late: false,
            sparse: false,
            reply_end: Duration::ZERO,
            colon_spoilt: false,
            last: None,
            waiting: false,
            deaf: false,
            dead: false,
        }
    }

    /// A modio with this fault.
    pub fn modio(fault: Option<ModioFault>, mode: Mode, line: LineFormat) -> Self {
        let mut unit = Self::new(None, mode, line);
        unit.address = modio::UNIT;
        let mut modio = Modio::new(fault);
        unit.line = modio.start(Duration::ZERO, true);
        unit.server.modio = Some(modio);
        unit
    }

    /// Restarts the unit at this instant.
    pub fn start(&mut self, at: Duration) {
        let old = std::mem::replace(self, Self::new(self.server.fault, self.mode, self.line));
        self.edges = old.edges;
        (self.address, self.master) = (old.address, old.master);
        self.server.modio = old.server.modio;
        if let Some(modio) = &mut self.server.modio {
            self.line = modio.start(at, true);
        }
        self.own_characters = old.own_characters;
        self.silent_to_incomplete_writes = old.silent_to_incomplete_writes;
        self.last = Some(at);
        self.waiting = true;
        self.dead = self.server.has(Fault::DeadAfterPowerOff);
        if self.server.has(Fault::ZeroAtStart) {
            self.sent.push_back(Received {
                byte: 0,
                start: at,
                end: at + self.line.characters(1),
                good: true,
            });
        }
    }

    /// When the open frame ends, if no further character is received.
    pub fn closes(&self) -> Option<Duration> {
        self.last.map(|last| last + self.silence())
    }

    fn t15(&self) -> Duration {
        if self.own_characters {
            self.line.characters(1) * 3 / 2
        } else {
            self.line.t15()
        }
    }

    fn t35(&self) -> Duration {
        if self.own_characters {
            self.line.characters(1) * 7 / 2
        } else {
            self.line.t35()
        }
    }

    fn silence(&self) -> Duration {
        match self.mode {
            Mode::Rtu if self.server.has(Fault::JoinsParts) => self.t35() * 4,
            Mode::Rtu if self.server.has(Fault::ClosesEarly) => self.t35() * 3 / 4,
            Mode::Rtu if self.server.has(Fault::ClosesAtT15) => self.t15(),
            Mode::Rtu => self.t35(),
            Mode::Ascii if self.server.has(Fault::ImpatientInAscii) => Duration::from_millis(500),
            Mode::Ascii if self.server.has(Fault::JoinsParts) => Duration::from_secs(3),
            Mode::Ascii => Duration::from_secs(1),
        }
    }

    /// Receives a pulse that is too short for a character.
    pub fn glitch(&mut self, at: Duration) {
        if self.server.has(Fault::PulsesRestartSilence) {
            self.last = self.last.map(|_| at);
        }
        self.deaf |= self.server.has(Fault::DeafAfterGlitch);
    }

    /// Receives a character.
    pub fn receive(&mut self, character: Character) {
        if self.line != self.master {
            return;
        }
        let fast = character.start < self.reply_end + self.line.t15();
        if fast && self.server.modio_has(ModioFault::LosesFastRequests) {
            return;
        }
        if let Some(last) = self.last {
            let gap = character.start.saturating_sub(last);
            let near_the_end = self.open.len() > 5;
            let longest = if self.server.has(Fault::DropsShortGaps) {
                self.t15() / 3
            } else {
                self.t15()
            };
            self.sparse |= gap > longest;
            self.late |=
                gap > self.t15() && (!self.server.has(Fault::StrictSometimes) || near_the_end);
        }
        self.last = Some(character.end);
        let parity = character.parity_error && !self.server.has(Fault::IgnoresParity);
        let stop = character.stop_error && !self.server.has(Fault::IgnoresStop);
        let slow = self.server.has(Fault::SlowToListen) && self.open.is_empty();
        let missed = slow && character.start < self.reply_end + self.t35() * 2;
        let damaged = parity || stop || missed;
        if character.stop_error && character.byte == 0 && self.server.has(Fault::DeafAfterBreak) {
            self.deaf = true;
        }
        self.damaged |= damaged;
        if self.mode == Mode::Ascii {
            self.receive_ascii(character, damaged);
        } else {
            self.open.push(character.byte);
        }
    }

    fn receive_ascii(&mut self, character: Character, damaged: bool) {
        let in_rtu = self.open.first().is_none_or(|first| *first != b':') && character.byte != b':';
        if in_rtu && self.server.has(Fault::TakesRtuInAscii) {
            self.open.push(character.byte);
            if self.open.len() == 8 && crc(&self.open[..6]) == self.open[6..] {
                let frame = std::mem::take(&mut self.open);
                self.message(frame[..6].to_vec(), true, character.end);
            }
            return;
        }
        let spoilt = std::mem::replace(&mut self.colon_spoilt, false);
        if self.open.is_empty() && character.byte != b':' && self.server.has(Fault::NeedsColonFirst)
        {
            self.colon_spoilt = true;
        }
        if self.server.has(Fault::KeepsTruncated) && character.byte == b':' && !self.open.is_empty()
        {
            self.damaged = true;
            return;
        }
        let restarts = !self.server.has(Fault::FindsRequests) || self.open.is_empty();
        if character.byte == b':' && restarts {
            self.open.clear();
            self.damaged = false;
            if damaged || spoilt {
                // A damaged colon starts no frame.
                return;
            }
        } else if self.open.is_empty() {
            return;
        }
        self.open.push(character.byte);
        let longest = if self.server.has(Fault::ShortBuffer) {
            511
        } else {
            513
        };
        if self.open.len() > longest && !self.server.has(Fault::TakesLongFrames) {
            self.open.clear();
        } else if self
            .open
            .ends_with(&[b'\r', self.reference.delimiter.unwrap_or(b'\n')])
        {
            let frame = std::mem::take(&mut self.open);
            let any = self.server.has(Fault::TakesAnyDigit);
            let digits = frame[1..].iter().map(|byte| {
                let digit = (*byte as char).to_digit(16);
                digit.or((any && !byte.is_ascii_control()).then_some(0))
            });
            let values: Vec<u8> = digits.map_while(|d| d.map(|d| d as u8)).collect();
            let upper =
                !frame.iter().any(u8::is_ascii_lowercase) || self.server.has(Fault::TakesLowerCase);
            let whole = values.len() + 3 == frame.len() && values.len().is_multiple_of(2) && upper;
            let bytes: Vec<u8> = values
                .chunks(2)
                .map(|d| d[0] << 4 | d.get(1).unwrap_or(&0))
                .collect();
            if let Some((check, body)) = bytes.split_last().filter(|_| whole) {
                let good = *check == lrc(body) || self.server.has(Fault::IgnoresCrc);
                self.message(body.to_vec(), good && !self.damaged, character.end);
            } else {
                self.spoilt();
            }
            self.last = None;
        }
    }

    /// Ends a frame after its silence.
    pub fn close(&mut self, at: Duration) {
        let frame = std::mem::take(&mut self.open);
        let (damaged, late) = (self.damaged, self.late);
        let sparse = std::mem::take(&mut self.sparse) && self.server.has(Fault::DropsShortGaps);
        self.last = None;
        (self.damaged, self.late) = (false, false);
        let waited = std::mem::take(&mut self.waiting);
        let haste = self.server.has(Fault::HasteAtStart);
        if (waited && !haste) || self.mode == Mode::Ascii || sparse {
            return;
        }
        let sometimes = self.server.has(Fault::StrictSometimes);
        if late && sometimes {
            return;
        }
        let longest = if self.server.has(Fault::ShortBuffer) {
            254
        } else {
            256
        };
        let long = frame.len() > longest && !haste && !self.server.has(Fault::TakesLongFrames);
        let mut body = frame.clone();
        let check = [body.pop(), body.pop()].map(|byte| byte.unwrap_or(0));
        let right = crc(&body);
        let mut good = [check[1], check[0]] == right || self.server.has(Fault::IgnoresCrc);
        good |= self.server.has(Fault::TakesSwappedCrc) && check == right;
        let finds = self.server.has(Fault::FindsRequests) || (waited && haste);
        if finds && !good && frame.len() > 8 {
            let tail = &frame[frame.len() - 8..];
            if crc(&tail[..6]) == tail[6..] {
                (body, good) = (tail[..6].to_vec(), true);
            }
        }
        if self.server.has(Fault::IgnoresTrailingByte) && !good && frame.len() > 4 {
            let inner = &frame[..frame.len() - 3];
            if crc(inner) == frame[frame.len() - 3..frame.len() - 1] {
                (body, good) = (inner.to_vec(), true);
            }
        }
        self.message(body, good && !damaged && !long && frame.len() >= 4, at);
    }

    /// Counts and logs a frame with a bad check or a damaged character.
    fn spoilt(&mut self) {
        self.reference.bad(false);
        if self.server.has(Fault::ErrorsUncounted) {
            self.reference.counters[ERRORS] -= 1;
        }
        if self.server.has(Fault::ErrorsUnlogged) {
            self.reference.unlogged.0 -= 1;
        }
    }

    fn message(&mut self, body: Vec<u8>, good: bool, at: Duration) {
        if !good || body.len() < 2 {
            if let Some(modio) = &mut self.server.modio {
                modio.other_frame(at, ModioFault::BadFramesAreLife);
            }
            self.spoilt();
            self.deaf |= self.server.has(Fault::DeafAfterBadFrames);
            if self.server.has(Fault::AnswersNoise) && body.first() == Some(&self.address) {
                self.send(&[self.address, 0x80, 1], at);
            }
            return;
        }
        let (unit, pdu) = (body[0], &body[1..]);
        let broadcast = unit == 0 || (unit == 255 && self.server.has(Fault::Obeys255));
        let mine = unit == self.address
            || broadcast
            || (unit == self.address ^ 1 && self.server.has(Fault::AnswersNeighbour))
            || (unit >= 248 && self.server.has(Fault::AnswersReserved));
        if mine || !self.server.has(Fault::DeafCounter) {
            self.reference.counters[BUS] += 1;
        }
        if self.dead || std::mem::take(&mut self.deaf) {
            return;
        }
        if self.has_fast() && unit == fast::ADDRESS && pdu[0] == fast::FUNCTION {
            self.serve_all_units(pdu, at);
            return;
        }
        if !mine {
            if let Some(modio) = &mut self.server.modio {
                modio.other_frame(at, ModioFault::OtherUnitsAreLife);
            }
            if self.server.has(Fault::LogsOthers) {
                self.reference.log.push(0x80);
            }
            if self.server.has(Fault::RefusesForOthers) && pdu[0] > 0x2B {
                self.send(&[unit, pdu[0] | 0x80, 1], at);
            }
            if self.server.has(Fault::RefusesForUnit1) && unit == 1 {
                self.send(&[unit, pdu[0] | 0x80, 1], at);
            }
            self.deaf = self.server.has(Fault::DeafAfterOthers) && pdu.len() == 3;
            self.deaf |= self.server.has(Fault::DeafAfterLongReplies) && pdu.len() > 200;
            if self.server.has(Fault::FindsInside) {
                let inside = body
                    .windows(8)
                    .find(|w| w[0] == self.address && crc(&w[..6]) == w[6..]);
                if let Some(inside) = inside.map(<[u8]>::to_vec) {
                    self.serve(&inside[1..6], false, at);
                }
            }
            return;
        }
        self.dead = pdu[0] == 0 && self.server.has(Fault::DiesOf00);
        self.serve(pdu, broadcast, at);
    }

    fn serve(&mut self, pdu: &[u8], broadcast: bool, at: Duration) {
        if let Some(modio) = &mut self.server.modio {
            modio.request(at, broadcast, pdu);
        }
        if self.silent_to_incomplete_writes && !is_complete(pdu) {
            return;
        }
        let reply = if pdu[0] == fast::FUNCTION && self.has_fast() && !broadcast {
            Some(self.settings(pdu))
        } else {
            self.server.request(&mut self.reference, broadcast, pdu)
        };
        if let Some(reply) = reply {
            if self.server.modio_has(ModioFault::RestartsBeforeReply) {
                self.restart(at);
            }
            let delay = self.server.modio.as_ref().map(Modio::response_delay);
            let body = [vec![self.address], reply].concat();
            self.send(&body, at + delay.unwrap_or_default());
            self.restart(at);
        }
    }

    /// Returns whether the unit has function 70: only in RTU mode, and not as a modio. This unit does not have all that the
    /// suite expects of a modio with function 70.
    const fn has_fast(&self) -> bool {
        matches!(self.mode, Mode::Rtu) && self.server.modio.is_none()
    }

    /// Restarts a modio after the command to restart.
    fn restart(&mut self, at: Duration) {
        let modio = self.server.modio.as_mut();
        if let Some(line) = modio.and_then(|modio| modio.restart(at)) {
            self.line = line;
        }
    }

    pub fn send(&mut self, body: &[u8], at: Duration) {
        let delimiter = (self.mode == Mode::Ascii).then_some(b'\n');
        let mut frame = framed(delimiter, body[0], &body[1..]);
        if self.server.has(Fault::TrailingZero) {
            frame.push(0);
        }
        let character = self.line.characters(1);
        let mut start = at + THINKING;
        if self.server.has(Fault::RepliesEarly) {
            start = start.saturating_sub(self.t35() / 2);
        }
        self.edges.push((start, true));
        for (n, byte) in frame.iter().enumerate() {
            if n == 3 && self.server.has(Fault::Pauses) {
                start += self.line.t15() * 2;
            }
            let end = start + character;
            self.sent.push_back(Received {
                byte: *byte,
                start,
                end,
                good: self.line == self.master,
            });
            start = end;
        }
        self.reply_end = start;
        let early = self.server.has(Fault::ReleasesEarly);
        self.edges
            .push((if early { start - character } else { start }, false));
        if self.echo && self.server.has(Fault::HearsItself) {
            // One reply to its own reply is enough to be wrong; more would never end.
            self.echo = false;
            let body = body.to_vec();
            self.message(body, true, start + self.line.t35());
            self.echo = true;
        }
    }
}

/// Whether the byte count of a write of several points is the number of its data bytes.
fn is_complete(pdu: &[u8]) -> bool {
    let at = match pdu[0] {
        0x0F | 0x10 => 5,
        0x17 => 9,
        _ => return true,
    };
    pdu.get(at)
        .is_some_and(|count| pdu.len() == at + 1 + usize::from(*count))
}
