//! The tools of a case: the endpoint, what is known about the unit, and steps that send requests and check replies.

use std::fmt::Display;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use serde_json::Value;

use crate::check::{Check, Failure, Part, Stop, skip};
use crate::endpoint::{Broken, Endpoint, Piece, Received, shown};
use crate::frame::{Reply, hex};
use crate::target::{Patience, Target};

/// The tools of a case.
///
/// # Errors
///
/// The steps that return a [`Check`] fail with [`Stop::Broken`] when the endpoint no longer works, with [`Stop::Fail`]
/// when the unit does not do what the step demands, and with [`Stop::Skip`] when the unit does not have what the step
/// needs.
pub struct Tester<'a> {
    /// The line.
    pub endpoint: &'a mut dyn Endpoint,
    /// The unit.
    pub target: &'a Target,
    /// How long to wait; a case may change it.
    pub patience: Patience,
    /// Number of due replies that were missing, so that the request was repeated.
    pub asked_again: u32,
    /// The last request and the reply, for people.
    sent: String,
    came: String,
    /// The end of the last request.
    pub sent_end: Duration,
    /// The characters of the last reply.
    pub received: Vec<Received>,
    /// Set when the user ends the run. A case that takes long ends early then.
    pub stop: &'a AtomicBool,
}

/// What [`Tester::stop`] is when nobody can end the run.
static NEVER: AtomicBool = AtomicBool::new(false);

impl<'a> Tester<'a> {
    /// Returns the tools for this line and unit.
    pub fn new(endpoint: &'a mut dyn Endpoint, target: &'a Target) -> Self {
        Self {
            endpoint,
            target,
            patience: target.patience,
            asked_again: 0,
            sent: String::new(),
            came: String::new(),
            sent_end: Duration::ZERO,
            received: Vec::new(),
            stop: &NEVER,
        }
    }

    /// Skips the rest of the case when the user ends the run.
    pub fn go_on(&self) -> Check {
        if self.stop.load(Ordering::Relaxed) {
            return skip("interrupted");
        }
        Ok(())
    }

    /// Carries out a part of a case. A mistake of the unit is the result of the part; anything else ends the case.
    pub fn part(
        &mut self,
        name: String,
        test: impl FnOnce(&mut Self, &mut Part) -> Check,
    ) -> Check<Part> {
        let begin = self.endpoint.now();
        let mut part = Part {
            name,
            note: String::new(),
            measured: Value::Null,
            result: Ok(()),
            time: Duration::ZERO,
        };
        match test(self, &mut part) {
            Err(Stop::Fail(failure)) => part.result = Err(failure),
            other => other?,
        }
        part.time = self.endpoint.now().saturating_sub(begin);
        Ok(part)
    }

    /// Returns the unit's address.
    pub fn unit(&self) -> u8 {
        self.target.unit
    }

    /// Another unit's address, an ordinary one.
    pub fn other(&self) -> u8 {
        if self.target.unit == 42 { 43 } else { 42 }
    }

    /// Returns one of two values: the first where the endpoint's time is exact.
    pub fn exact<T>(&self, exact: T, otherwise: T) -> T {
        if self.endpoint.abilities().exact {
            exact
        } else {
            otherwise
        }
    }

    /// Returns the frame of a request to this unit.
    pub fn frame(&self, pdu: &[u8]) -> Vec<u8> {
        self.target.mode.frame(self.target.unit, pdu)
    }

    /// Fails the case at its last exchange. `wanted` is what should have been received.
    pub fn fail<T>(&self, wanted: impl Display) -> Check<T> {
        Err(Stop::Fail(Failure {
            sent: self.sent.clone(),
            came: self.came.clone(),
            wanted: wanted.to_string(),
        }))
    }

    /// Fails like [`Tester::fail`] unless the condition is true.
    pub fn ensure(&self, holds: bool, wanted: impl Display) -> Check {
        if holds { Ok(()) } else { self.fail(wanted) }
    }

    /// Sends pieces and receives the reply.
    pub fn exchange(&mut self, pieces: &[Piece]) -> Check<Reply> {
        self.exchange_until(pieces, usize::MAX)
    }

    /// Sends pieces and receives the reply. Returns as soon as `enough` characters have been received.
    pub fn exchange_until(&mut self, pieces: &[Piece], enough: usize) -> Check<Reply> {
        self.sent = shown(pieces);
        // A late reply to an earlier request must not look like the reply to this one.
        self.endpoint.flush()?;
        self.sent_end = self.endpoint.send(pieces)?;
        self.listen_until(enough)
    }

    /// Sends pieces to which a reply is due. Where requests may get lost on the way, they are repeated once when
    /// there is no reply.
    pub fn exchange_due(&mut self, pieces: &[Piece]) -> Check<Reply> {
        let reply = self.exchange(pieces)?;
        if reply != Reply::Silence || !self.endpoint.abilities().asks_again {
            return Ok(reply);
        }
        self.asked_again += 1;
        self.exchange(pieces)
    }

    /// Receives a reply without sending a request.
    pub fn listen_until(&mut self, enough: usize) -> Check<Reply> {
        self.received = self
            .endpoint
            .receive(self.patience.reply, self.patience.quiet, enough)?;
        let mut bytes: Vec<u8> = self.received.iter().map(|received| received.byte).collect();
        // An operating system may deliver a frame in parts: wait for the rest of a part.
        let whole = |bytes: &[u8]| bytes.is_empty() || self.target.mode.decode(bytes).is_ok();
        while !self.endpoint.abilities().exact && bytes.len() < enough && !whole(&bytes) {
            let quiet = self.patience.quiet;
            let missing = enough - bytes.len();
            let more = self.endpoint.receive(quiet * 5, quiet, missing)?;
            if more.is_empty() {
                break;
            }
            bytes.extend(more.iter().map(|received| received.byte));
            self.received.extend(more);
        }
        let reply = if bytes.is_empty() {
            Reply::Silence
        } else if self.received.iter().any(|received| !received.good) {
            Reply::Wrong(bytes, "damaged characters".to_owned())
        } else {
            match self.target.mode.decode(&bytes) {
                Ok((unit, pdu)) if unit == self.target.unit => Reply::Pdu(pdu),
                Ok((unit, _)) => Reply::Wrong(bytes, format!("from unit {unit}")),
                Err(why) => Reply::Wrong(bytes, why),
            }
        };
        self.came = reply.to_string();
        Ok(reply)
    }

    /// Sends raw bytes.
    pub fn raw(&mut self, bytes: &[u8]) -> Check<Reply> {
        self.exchange(&[Piece::Bytes(bytes.to_vec())])
    }

    /// Sends raw bytes to which a reply is due.
    pub fn raw_due(&mut self, bytes: &[u8]) -> Check<Reply> {
        self.exchange_due(&[Piece::Bytes(bytes.to_vec())])
    }

    /// Sends a PDU in a good frame to any unit.
    pub fn ask_unit(&mut self, unit: u8, pdu: &[u8]) -> Check<Reply> {
        let frame = self.target.mode.frame(unit, pdu);
        self.raw(&frame)
    }

    /// Sends a PDU to the unit under test.
    pub fn ask(&mut self, pdu: &[u8]) -> Check<Reply> {
        self.ask_unit(self.target.unit, pdu)
    }

    /// Sends a PDU to the unit under test. A reply is due.
    pub fn ask_due(&mut self, pdu: &[u8]) -> Check<Reply> {
        let frame = self.frame(pdu);
        self.raw_due(&frame)
    }

    /// Sends a PDU and expects an ordinary reply, which begins with the function code. Returns the reply.
    pub fn reply(&mut self, pdu: &[u8]) -> Check<Vec<u8>> {
        match self.ask_due(pdu)? {
            Reply::Pdu(reply) if reply[0] == pdu[0] => Ok(reply),
            _ => self.fail(format!("a reply to function {:02X}", pdu[0])),
        }
    }

    /// Sends a PDU and expects exactly this PDU in reply.
    pub fn reply_is(&mut self, pdu: &[u8], wanted: &[u8]) -> Check {
        let right = self.ask_due(pdu)? == Reply::Pdu(wanted.to_vec());
        self.ensure(right, format!("the PDU {}", hex(wanted)))
    }

    /// Sends a PDU and expects this exception.
    pub fn exception(&mut self, pdu: &[u8], code: u8) -> Check {
        let reply = self.ask_due(pdu)?;
        let wanted = format!("exception {code:02X} to function {:02X}", pdu[0]);
        self.ensure(reply.exception(pdu[0]) == Some(code), wanted)
    }

    /// Sends a PDU whose last byte before the data is the byte count, and expects exception 03. If the byte count
    /// differs from the number of data bytes, silence is right as well, because the frame is not complete.
    pub fn exception_03_with(&mut self, head: &[u8], data: &[u8]) -> Check {
        let request = [head, data].concat();
        if head.last().copied().map(usize::from) == Some(data.len()) {
            self.exception(&request, 3)
        } else {
            self.exception_03_or_silence(&request)
        }
    }

    /// Sends a PDU of the wrong length and expects exception 03 or silence.
    pub fn exception_03_or_silence(&mut self, pdu: &[u8]) -> Check {
        let reply = self.ask(pdu)?;
        let right = reply == Reply::Silence || reply.exception(pdu[0]) == Some(3);
        let wanted = format!("exception 03 to function {:02X}, or silence", pdu[0]);
        self.ensure(right, wanted)
    }

    /// Sends every beginning of a PDU that is shorter than the PDU, and the PDU with some bytes added. Each must get
    /// exception 03 or silence.
    pub fn wrong_lengths(&mut self, pdu: &[u8], added: &[usize]) -> Check {
        for length in 1..pdu.len() {
            self.exception_03_or_silence(&pdu[..length])?;
        }
        for count in added {
            self.exception_03_or_silence(&[pdu, &vec![0; *count]].concat())?;
        }
        Ok(())
    }

    /// Sends pieces and expects silence.
    pub fn silence(&mut self, pieces: &[Piece], why: impl Display) -> Check {
        let patience = self.patience;
        self.patience.reply = patience.silence;
        let reply = self.exchange(pieces);
        self.patience = patience;
        self.ensure(reply? == Reply::Silence, format!("silence: {why}"))
    }

    /// Sends raw bytes and expects silence.
    pub fn silence_to(&mut self, bytes: &[u8], why: impl Display) -> Check {
        self.silence(&[Piece::Bytes(bytes.to_vec())], why)
    }

    /// Sends a PDU in a good frame to a unit, or to all units, and expects silence.
    pub fn silence_of(&mut self, unit: u8, pdu: &[u8], why: impl Display) -> Check {
        let frame = self.target.mode.frame(unit, pdu);
        self.silence_to(&frame, why)
    }

    /// Sends the request of [`Tester::alive`] to another unit, or to all units, and expects silence.
    pub fn silent_ping(&mut self, unit: u8, why: impl Display) -> Check {
        self.silence_of(unit, &self.target.ping, why)
    }

    /// Sends an ordinary request, which the unit must answer.
    pub fn alive(&mut self, after: impl Display) -> Check {
        let ping = self.target.ping.clone();
        let before = self.sent.clone();
        match self.ask_due(&ping)? {
            Reply::Pdu(reply) if reply[0] == ping[0] => Ok(()),
            _ => {
                self.sent = format!("{before}; then {}", self.sent);
                self.fail(format!("a good request is answered after {after}"))
            }
        }
    }

    /// Sends pieces that end with the request of [`Tester::alive`]. The unit has to reply to that request.
    pub fn answers(&mut self, pieces: &[Piece], wanted: impl Display) -> Check {
        let reply = self.exchange_due(pieces)?;
        self.ensure(self.is_pong(&reply), wanted)
    }

    /// Returns the frame of the request of [`Tester::alive`].
    pub fn ping(&self) -> Vec<u8> {
        self.frame(&self.target.ping)
    }

    /// Returns whether a reply is right for the request of [`Tester::alive`].
    pub fn is_pong(&self, reply: &Reply) -> bool {
        matches!(reply, Reply::Pdu(pdu) if pdu[0] == self.target.ping[0])
    }

    /// Sends a PDU and returns the reply. Skips the case when the reply is exception 01, because then the unit has no
    /// `what`.
    pub fn reply_unless_lacking(&mut self, pdu: &[u8], what: &str) -> Check<Vec<u8>> {
        match self.ask_due(pdu)? {
            reply if reply.exception(pdu[0]) == Some(1) => {
                Err(Stop::Skip(format!("the unit answers 01: it has no {what}")))
            }
            Reply::Pdu(reply) if reply[0] == pdu[0] => Ok(reply),
            _ => self.fail(format!("a reply, or exception 01: {what}")),
        }
    }

    /// Returns the time from the end of the last request to the first start bit of the reply.
    pub fn turnaround(&self) -> Duration {
        let first = self.received.first();
        let start = first.map_or(Duration::ZERO, |first| first.start);
        start.saturating_sub(self.sent_end)
    }

    /// Lets time pass.
    pub fn rest(&mut self, time: Duration) -> Result<(), Broken> {
        self.endpoint.rest(time)
    }
}

/// Returns two runs of bytes with a gap between them.
pub fn apart(first: &[u8], gap: Duration, second: &[u8]) -> [Piece; 3] {
    [
        Piece::Bytes(first.to_vec()),
        Piece::Gap(gap),
        Piece::Bytes(second.to_vec()),
    ]
}

/// Returns a frame in which the character at `index` is damaged in this way.
pub fn damaged_at(frame: &[u8], index: usize, damage: fn(u8) -> Piece) -> [Piece; 3] {
    [
        Piece::Bytes(frame[..index].to_vec()),
        damage(frame[index]),
        Piece::Bytes(frame[index + 1..].to_vec()),
    ]
}
