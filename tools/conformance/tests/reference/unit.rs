//! The reference server on a line: what is a frame, whom it is for, and when it replies.

use std::collections::VecDeque;
use std::time::Duration;

use conformance::endpoint::Heard;
use conformance::frame::{Mode, crc, lrc};
use conformance::line::LineFormat;

use super::fault::Fault;
use super::server::{SILENT, Server};

/// The unit's address.
pub const UNIT: u8 = 9;

/// From the end of the silence to the reply.
const THINKING: Duration = Duration::from_micros(40);

/// A character as it stands on the line.
#[derive(Clone, Copy, Debug)]
pub struct Sign {
    pub byte: u8,
    pub start: Duration,
    pub end: Duration,
    pub parity_error: bool,
    pub stop_error: bool,
}

/// The unit.
pub struct Unit {
    pub server: Server,
    pub mode: Mode,
    pub line: LineFormat,
    /// Counts characters of the line's format for t1.5 and t3.5, not characters of 11 bits.
    pub own_characters: bool,
    /// What it says, and its driver's edges.
    pub said: VecDeque<Heard>,
    pub edges: Vec<(Duration, bool)>,
    pub echo: bool,
    open: Vec<u8>,
    damaged: bool,
    late: bool,
    last: Option<Duration>,
    /// No silence has come yet since power-on.
    waiting: bool,
    deaf: bool,
    dead: bool,
}

impl Unit {
    pub fn new(fault: Option<Fault>, mode: Mode, line: LineFormat) -> Self {
        Self {
            server: Server::new(fault),
            mode,
            line,
            own_characters: false,
            said: VecDeque::new(),
            edges: Vec::new(),
            echo: false,
            open: Vec::new(),
            damaged: false,
            late: false,
            last: None,
            waiting: false,
            deaf: false,
            dead: false,
        }
    }

    /// Started again at this instant.
    pub fn start(&mut self, at: Duration) {
        let old = std::mem::replace(self, Self::new(self.server.fault, self.mode, self.line));
        self.edges = old.edges;
        self.own_characters = old.own_characters;
        self.last = Some(at);
        self.waiting = true;
    }

    /// When the frame that is open will be over, if nothing else comes.
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
            Mode::Ascii if self.server.has(Fault::JoinsParts) => Duration::from_secs(3),
            Mode::Ascii => Duration::from_secs(1),
        }
    }

    /// A character comes.
    pub fn hear(&mut self, sign: Sign) {
        if let Some(last) = self.last {
            let gap = sign.start.saturating_sub(last);
            let near_the_end = self.open.len() > 5;
            self.late |=
                gap > self.t15() && (!self.server.has(Fault::StrictSometimes) || near_the_end);
        }
        self.last = Some(sign.end);
        let parity = sign.parity_error && !self.server.has(Fault::IgnoresParity);
        let stop = sign.stop_error && !self.server.has(Fault::IgnoresStop);
        let damaged = parity || stop;
        self.damaged |= damaged;
        if self.mode == Mode::Ascii {
            self.hear_ascii(sign, damaged);
        } else {
            self.open.push(sign.byte);
        }
    }

    fn hear_ascii(&mut self, sign: Sign, damaged: bool) {
        let restarts = !self.server.has(Fault::FindsRequests) || self.open.is_empty();
        if sign.byte == b':' && restarts {
            self.open.clear();
            self.damaged = false;
            if damaged {
                // A damaged colon starts no frame.
                return;
            }
        } else if self.open.is_empty() {
            return;
        }
        self.open.push(sign.byte);
        if self.open.len() > 513 && !self.server.has(Fault::TakesLongFrames) {
            self.open.clear();
        } else if self.open.ends_with(&[b'\r', self.server.delimiter]) {
            let frame = std::mem::take(&mut self.open);
            let digits = frame[1..].iter().map(|byte| (*byte as char).to_digit(16));
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
                self.message(body.to_vec(), good && !self.damaged, sign.end);
            } else {
                self.spoilt();
            }
            self.last = None;
        }
    }

    /// The silence that ends a frame has come.
    pub fn close(&mut self, at: Duration) {
        let frame = std::mem::take(&mut self.open);
        let (damaged, late) = (self.damaged, self.late);
        self.last = None;
        (self.damaged, self.late) = (false, false);
        let waited = std::mem::take(&mut self.waiting);
        let haste = self.server.has(Fault::HasteAtStart);
        if (waited && !haste) || self.mode == Mode::Ascii {
            return;
        }
        let sometimes = self.server.has(Fault::StrictSometimes);
        if late && sometimes {
            return;
        }
        let long = frame.len() > 256 && !haste && !self.server.has(Fault::TakesLongFrames);
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
        self.message(body, good && !damaged && !long && frame.len() >= 4, at);
    }

    /// A frame is lost to a bad check or a damaged character.
    fn spoilt(&mut self) {
        if !self.server.has(Fault::ErrorsUncounted) {
            self.server.log.count(0x0C);
        }
        if !self.server.has(Fault::ErrorsUnlogged) {
            self.server.log.received(0x02);
        }
    }

    fn message(&mut self, body: Vec<u8>, good: bool, at: Duration) {
        if !good || body.len() < 2 {
            self.spoilt();
            if self.server.has(Fault::AnswersNoise) && body.first() == Some(&UNIT) {
                self.say(&[UNIT, 0x80, 1], at);
            }
            return;
        }
        let (unit, pdu) = (body[0], &body[1..]);
        let broadcast = unit == 0 || (unit == 255 && self.server.has(Fault::Obeys255));
        let mine = unit == UNIT || broadcast;
        if mine || !self.server.has(Fault::DeafCounter) {
            self.server.log.count(0x0B);
        }
        if self.dead || std::mem::take(&mut self.deaf) {
            return;
        }
        if !mine {
            if self.server.has(Fault::LogsOthers) {
                self.server.log.received(0);
            }
            if self.server.has(Fault::RefusesForOthers) && pdu[0] > 0x2B {
                self.say(&[unit, pdu[0] | 0x80, 1], at);
            }
            self.deaf = self.server.has(Fault::DeafAfterOthers) && pdu.len() == 3;
            return;
        }
        self.dead = pdu[0] == 0 && self.server.has(Fault::DiesOf00);
        self.serve(pdu, broadcast, at);
    }

    fn serve(&mut self, pdu: &[u8], broadcast: bool, at: Duration) {
        self.server.log.count(0x0E);
        let silent_before = self.server.log.listen_only;
        let as_broadcast = broadcast && !self.server.has(Fault::BroadcastsLoggedAsOthers);
        self.server.log.received(u8::from(as_broadcast) << 6);
        let restart = pdu[0] == 8 && pdu.get(1..3) == Some(&[0, 1]);
        if silent_before && !restart && !self.server.has(Fault::TalksInListenOnly) {
            if self.server.has(Fault::WritesInListenOnly) {
                // What it does is not told.
                let _ = self.server.answer(pdu);
            }
            self.server.log.count(0x0F);
            self.server.log.sent(0);
            return;
        }
        let obeys = !broadcast || pdu[0] != 8 || self.server.has(Fault::ObeysBroadcastDiagnostics);
        let answer = if obeys {
            self.server.answer(pdu)
        } else {
            Err(SILENT)
        };
        let listens = silent_before || self.server.log.listen_only;
        let silent = broadcast || (listens && !self.server.has(Fault::TalksInListenOnly));
        let polls = matches!(pdu[0], 0x0B | 0x0C);
        match &answer {
            Ok(_) if !polls => self.server.log.events = self.server.log.events.wrapping_add(1),
            Ok(_) | Err(SILENT) => {}
            Err(_) => {
                self.server.log.count(0x0D);
                if self.server.has(Fault::CountsExceptions) {
                    self.server.log.events = self.server.log.events.wrapping_add(1);
                }
            }
        }
        if silent && !self.server.has(Fault::AnswersBroadcasts) {
            if !self.server.has(Fault::SilenceUnlogged) {
                self.server.log.sent(0);
            }
            if !self.server.has(Fault::BroadcastsUncounted) {
                self.server.log.count(0x0F);
            }
            return;
        }
        let reply = match answer {
            Ok(data) => [vec![UNIT, pdu[0]], data].concat(),
            Err(1) if self.server.has(Fault::SilentToUnknown) => return,
            Err(SILENT) => return,
            Err(code) => vec![UNIT, pdu[0] | 0x80, code],
        };
        let kind = match reply[..] {
            _ if self.server.has(Fault::ExceptionsLoggedAsReplies) => 0,
            [_, function, code] if function & 0x80 != 0 => match code {
                1..=3 => 0x01,
                4 => 0x02,
                5 | 6 => 0x04,
                _ => 0x08,
            },
            _ => 0,
        };
        if !self.server.has(Fault::RepliesUnlogged) {
            self.server.log.sent(kind);
        }
        self.say(&reply, at);
    }

    fn say(&mut self, body: &[u8], at: Duration) {
        let mut frame = match self.mode {
            Mode::Rtu => [body, &crc(body)].concat(),
            Mode::Ascii => conformance::frame::ascii(body, lrc(body)),
        };
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
            self.said.push_back(Heard {
                byte: *byte,
                start,
                end,
                good: true,
            });
            start = end;
        }
        let early = self.server.has(Fault::ReleasesEarly);
        self.edges
            .push((if early { start - character } else { start }, false));
        if self.echo && self.server.has(Fault::HearsItself) {
            // One round is enough to be wrong, and it must end.
            self.echo = false;
            let body = body.to_vec();
            self.message(body, true, start + self.line.t35());
            self.echo = true;
        }
    }
}
