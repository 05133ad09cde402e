//! Requests in, decisions and replies out.

mod serving;
mod settle;
mod tally;
mod work;

use crate::decision::Job;
use crate::diagnostic::Diagnostic;
use crate::events::EventLog;
use crate::head::Head;
use crate::line::Framing;
use crate::{Adu, Counters, DataModel, Decision, Function, LineCounters, Outcome, Work};
pub use serving::{Answered, Committed, Decided, Request, Served};
use tally::Tally;

/// The unit address of a broadcast (V1.02 2.2).
pub(crate) const BROADCAST: u8 = 0;

/// The server of one line: serves the requests that its [`Port`](crate::line::Port) has received, for one data model.
///
/// [`serve`](Self::serve) serves a request, and [`take`](Self::take) begins to serve one step by step.
///
/// A port may have several unit addresses ([`UnitSet`](crate::line::UnitSet)). Its reply has the address of the request.
/// For the standard's diagnostics they are one unit: counters, event log and listen-only mode belong to all of them
/// together. A request to any address is counted, one puts all of them into listen-only mode, and one restarts them.
/// [`Port::waiting`](crate::line::Port::waiting) and [`Request::unit`] say which address a request is for, so that the
/// caller can give the server a model that depends on it.
#[derive(Debug)]
pub struct Server {
    framing: Framing,
    /// Function 08, sub-function 04, was obeyed, and 01 not since then.
    listen_only: bool,
    /// Function 08, sub-function 04, can be obeyed.
    can_listen_only: bool,
    /// The line's counters as last seen, and as they were when they were last cleared.
    line: LineCounters,
    cleared: LineCounters,
    /// Bits of the diagnostic register that were set when it was cleared and have stayed so.
    cleared_bits: u16,
    tally: Tally,
    log: EventLog,
}

/// What becomes of a request, by its first bytes.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Hearing {
    /// Nothing.
    Dismissed(Outcome),
    /// It is decided upon and answered.
    Answered,
    /// It is to all units.
    Broadcast,
    /// It is carried out in silence.
    Silent,
}

impl Server {
    /// A server for a line that starts with `framing`.
    pub const fn new(framing: Framing) -> Self {
        Self {
            framing,
            listen_only: false,
            can_listen_only: true,
            line: LineCounters::ZERO,
            cleared: LineCounters::ZERO,
            cleared_bits: 0,
            tally: Tally::ZERO,
            log: EventLog::new(),
        }
    }

    /// The same server without listen-only mode (function 08, sub-function 04, which silences the
    /// unit until sub-function 01 restarts it): the request for it is answered with exception 01.
    ///
    /// A server whose model does not [have](DataModel::has) function 08 must be without it: whether a request is
    /// answered at all is decided without the model, and one for listen-only mode never is.
    #[must_use]
    pub const fn without_listen_only(self) -> Self {
        Self {
            can_listen_only: false,
            ..self
        }
    }

    /// How the next reply is to be framed, and how the request after it will be. It changes when a
    /// request that changes it is carried out, whose own reply is under way by then.
    pub const fn framing(&self) -> Framing {
        self.framing
    }

    /// Whether the unit is in listen-only mode (V1.1b3 6.8, sub-function 04).
    pub const fn is_listen_only(&self) -> bool {
        self.listen_only
    }

    /// Whether `request` (unit address and PDU, without CRC) will be answered at all, be it with an
    /// exception. Takes the same few instructions for every request, where
    /// [`decide`](Self::decide) takes longer the more values there are to check: so the first byte
    /// of the reply, the unit address, can go out before the rest is decided.
    fn answers(&self, request: &Adu) -> bool {
        self.hear(request) == Hearing::Answered
    }

    fn hear(&self, request: &Adu) -> Hearing {
        let (unit, function) = (request.get(0), request.get(1));
        let broadcast = unit == BROADCAST;
        if !matches!(function, 1..Function::EXCEPTION) {
            return Hearing::Dismissed(Outcome::NoRequest);
        }
        let diagnostics = !broadcast && function == Function::Diagnostics.code();
        if self.listen_only {
            return if diagnostics && Diagnostic::is_restart(request.from(2)) {
                Hearing::Silent
            } else {
                Hearing::Dismissed(Outcome::NotObeyed)
            };
        }
        if broadcast {
            Hearing::Broadcast
        } else if self.can_listen_only && diagnostics && Diagnostic::is_listen_only(request.from(2))
        {
            Hearing::Silent
        } else {
            Hearing::Answered
        }
    }

    /// Settles the reply to `request` (unit address and PDU, without CRC): everything that can be
    /// refused is refused here. Changes nothing.
    fn decide(&self, request: &Adu, model: &impl DataModel) -> Decision {
        let (unit, function) = (request.get(0), request.get(1));
        let broadcast = unit == BROADCAST;
        let silence = |outcome| Decision {
            reply: None,
            work: Work(Job::None),
            outcome,
            broadcast,
        };
        let hearing = match self.hear(request) {
            Hearing::Dismissed(outcome) => return silence(outcome),
            hearing => hearing,
        };
        let settled = settle::settle(self, unit, function, request.from(2), model);
        let (head, work, outcome) = match settled {
            Ok((_, work)) if broadcast && !work.can_be_broadcast() => {
                return silence(Outcome::NoEffect);
            }
            Ok((head, work)) => (head, work, Outcome::Accepted),
            Err(exception) => {
                let head = Head::exception(unit, function, exception);
                (head, Job::None, Outcome::Refused(exception))
            }
        };
        Decision {
            reply: (hearing == Hearing::Answered).then_some(head),
            work: Work(work),
            outcome,
            broadcast,
        }
    }

    /// All counters as they stood when the last request was [committed](Answered::commit), less what function 08 has
    /// cleared.
    pub const fn counters(&self) -> Counters {
        self.counters_at(&self.line)
    }

    /// All counters with those of the line as they stand now
    /// ([`Receiver::counters`](crate::line::Receiver::counters)), less what function 08 has cleared.
    /// May be called at any time, also while a request is pending.
    pub const fn counters_at(&self, line: &LineCounters) -> Counters {
        let line = line.since(&self.cleared);
        let tally = &self.tally;
        Counters {
            bus_messages: line.bus_messages,
            communication_errors: line.communication_errors,
            exceptions: tally.exceptions,
            // A dropped frame was a message to this unit and got no reply. It is not in `busy`, which
            // counts exceptions 06 that were sent (V1.1b3 6.8.1).
            unit_messages: tally.unit_messages.wrapping_add(line.dropped),
            no_response: tally.no_response.wrapping_add(line.dropped),
            nak: tally.nak,
            busy: tally.busy,
            overruns: line.overruns,
            gaps: line.gaps,
        }
    }
}
