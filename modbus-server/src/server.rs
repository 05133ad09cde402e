//! Requests in, decisions and replies out.

use crate::counters::count;
use crate::pdu::Request;
use crate::{
    Adu, Bits, BitsOut, Counters, DataModel, Decision, Exception, Function, Head, LineCounters,
    Outcome, Words, WordsOut, Work,
};

/// The unit address of a broadcast (V1.02 2.2).
pub(crate) const BROADCAST: u8 = 0;

/// The server of one unit address on one line.
///
/// For each request: [`decide`](Self::decide), once or more often, then [`commit`](Self::commit)
/// and [`carry_out`](Self::carry_out), once each.
#[derive(Debug)]
pub struct Server {
    unit: u8,
    exceptions: u16,
    unit_messages: u16,
    no_response: u16,
    nak: u16,
    busy: u16,
}

impl Server {
    /// A server for unit address `unit`: 1-247, or one of 248-255, which the standard leaves to the
    /// device.
    pub const fn new(unit: u8) -> Self {
        Self {
            unit,
            exceptions: 0,
            unit_messages: 0,
            no_response: 0,
            nak: 0,
            busy: 0,
        }
    }

    /// Settles the reply to `request` (unit address and PDU, without CRC): everything that can be
    /// refused is refused here. Changes nothing, so it may be called ahead of time, on what
    /// [`Receiver::t15`](crate::rtu::Receiver::t15) lends.
    pub fn decide(&self, request: &Adu, model: &impl DataModel) -> Decision {
        let &[unit, function, ref fields @ ..] = request.as_slice() else {
            return Decision::silence(Outcome::NotForUs);
        };
        let broadcast = unit == BROADCAST;
        if !broadcast && unit != self.unit {
            return Decision::silence(Outcome::NotForUs);
        }
        if function == 0 || function & Function::EXCEPTION != 0 {
            return Decision::silence(Outcome::NoRequest);
        }
        let (head, work, outcome) = match settle(unit, function, fields, model) {
            Ok((head, work)) => (head, work, Outcome::Accepted),
            Err(exception) => (
                Head::exception(unit, function, exception),
                Work::None,
                Outcome::Refused(exception),
            ),
        };
        if broadcast {
            return Decision {
                reply: None,
                work: work.writes_only(),
                outcome,
            };
        }
        Decision {
            reply: Some(head),
            work,
            outcome,
        }
    }

    /// Takes note of a decision that is now being acted upon: the counters include it from here on.
    pub fn commit(&mut self, decision: &Decision) {
        if decision.outcome == Outcome::NotForUs {
            return;
        }
        count(&mut self.unit_messages);
        if decision.reply.is_none() {
            count(&mut self.no_response);
        }
        if let Outcome::Refused(exception) = decision.outcome {
            count(&mut self.exceptions);
            match exception {
                Exception::NegativeAcknowledge if decision.reply.is_some() => count(&mut self.nak),
                Exception::ServerDeviceBusy if decision.reply.is_some() => count(&mut self.busy),
                _ => {}
            }
        }
    }

    /// Does the work of a decision. `adu` is the request it was made on; afterwards, if the reply
    /// has a body ([`Head::body_len`]), `adu` holds it.
    pub fn carry_out(&self, decision: &Decision, adu: &mut Adu, model: &mut impl DataModel) {
        match decision.work {
            Work::None => {}
            Work::ReadBits(span) => {
                let bytes = adu.resize(usize::from(span.count().div_ceil(8)));
                model.read_bits(span, &mut BitsOut::new(bytes, span.count()));
            }
            Work::ReadWords(span) => {
                let mut out = WordsOut::new(adu.resize(usize::from(span.count()) * 2));
                model.read_words(span, &mut out);
                out.finish();
            }
            Work::WriteBits { span, from } => {
                model.write_bits(span, Bits::new(adu.from(from), span.count()));
            }
            Work::WriteWords { span, from } => {
                model.write_words(span, Words::new(adu.from(from)));
            }
        }
    }

    /// All counters: the server's own, and those of its line as [`Closed`](crate::rtu::Closed) or
    /// [`Receiver::counters`](crate::rtu::Receiver::counters) give them.
    pub const fn counters(&self, line: &LineCounters) -> Counters {
        Counters {
            bus_messages: line.bus_messages,
            communication_errors: line.communication_errors,
            exceptions: self.exceptions,
            unit_messages: self.unit_messages,
            no_response: self.no_response.wrapping_add(line.dropped),
            nak: self.nak,
            busy: self.busy.wrapping_add(line.dropped),
            overruns: line.overruns,
            gaps: line.gaps,
        }
    }
}

/// The reply and the work of a request that is accepted.
fn settle(
    unit: u8,
    function: u8,
    fields: &[u8],
    model: &impl DataModel,
) -> Result<(Head, Work), Exception> {
    match Request::decode(function, fields)? {
        Request::ReadBits(span) => {
            model.check_read_bits(span)?;
            // At most 2000 / 8.
            Ok((
                Head::read(unit, function, span.count().div_ceil(8) as u8),
                Work::ReadBits(span),
            ))
        }
        Request::ReadWords(span) => {
            model.check_read_words(span)?;
            // At most 125 * 2.
            Ok((
                Head::read(unit, function, (span.count() * 2) as u8),
                Work::ReadWords(span),
            ))
        }
        Request::WriteBits { span, bits, from } => {
            model.check_write_bits(span, bits)?;
            Ok((
                echo(unit, function, fields)?,
                Work::WriteBits { span, from },
            ))
        }
        Request::WriteWords { span, words, from } => {
            model.check_write_words(span, words)?;
            Ok((
                echo(unit, function, fields)?,
                Work::WriteWords { span, from },
            ))
        }
    }
}

/// The reply to a write: the first four bytes after the function code, as they came.
fn echo(unit: u8, function: u8, fields: &[u8]) -> Result<Head, Exception> {
    let fields = fields.first_chunk().ok_or(Exception::IllegalDataValue)?;
    Ok(Head::echo(unit, function, *fields))
}
