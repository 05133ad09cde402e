//! The server: takes requests, returns decisions and replies.

mod accept;
mod serving;
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

/// The server of one line. It serves the requests that its [`Port`](crate::line::Port) has received, for one data
/// model.
///
/// [`serve`](Self::serve) serves a request; [`take`](Self::take) begins to serve one step by step.
///
/// A port may have several unit addresses ([`UnitSet`](crate::line::UnitSet)). Its reply has the address of the
/// request. For the standard's diagnostics all addresses are one unit: they share counters, event log and
/// listen-only mode. A request to any address is counted, one request puts all addresses into listen-only mode, and
/// one request restarts them. [`Port::waiting`](crate::line::Port::waiting) and [`Request::unit`] return the
/// address of a request, so that the caller can pass the server a model that depends on the address.
#[derive(Debug)]
pub struct Server {
    framing: Framing,
    /// Function 08, sub-function 04, was executed, and 01 not since then.
    listen_only: bool,
    diagnostics: Diagnostics,
    /// The line's counters as last seen, and as they were when they were last cleared.
    line: LineCounters,
    cleared: LineCounters,
    /// Bits of the diagnostic register that were set when it was cleared and have been set ever since.
    cleared_bits: u16,
    tally: Tally,
    log: EventLog,
}

/// Sub-functions of function 08 that the server executes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Diagnostics {
    /// All of them.
    All,
    /// All but 04, which the server does not know.
    WithoutListenOnly,
    /// Those that change nothing. The others are refused.
    ReadOnly,
}

/// Treatment of a request, which its first bytes determine.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Handling {
    /// It is ignored.
    Dismissed(Outcome),
    /// It is decided upon and answered.
    Answered,
    /// It is a broadcast.
    Broadcast,
    /// It is executed without a reply.
    Silent,
}

impl Server {
    /// Creates a server for a line that starts with `framing`.
    pub const fn new(framing: Framing) -> Self {
        Self {
            framing,
            listen_only: false,
            diagnostics: Diagnostics::All,
            line: LineCounters::ZERO,
            cleared: LineCounters::ZERO,
            cleared_bits: 0,
            tally: Tally::ZERO,
            log: EventLog::new(),
        }
    }

    /// Disables listen-only mode (function 08, sub-function 04, which silences the unit until sub-function 01
    /// restarts it). A request for it is then answered with exception 01.
    ///
    /// This is required for a model that does not [have](DataModel::has) function 08. The server decides whether a
    /// request is answered without asking the model, and it never answers a request for listen-only mode.
    #[must_use]
    pub const fn without_listen_only(self) -> Self {
        Self {
            diagnostics: Diagnostics::WithoutListenOnly,
            ..self
        }
    }

    /// Limits function 08 to the sub-functions that change nothing: 00, 02 and 0B to 12. Each of the others is
    /// answered with exception 06, so nobody on this line can silence the unit or clear its counters.
    #[must_use]
    pub const fn with_read_only_diagnostics(self) -> Self {
        Self {
            diagnostics: Diagnostics::ReadOnly,
            ..self
        }
    }

    /// Returns the framing of the next reply and of the request after it. A request that changes it takes effect
    /// when it is executed; its own reply has already begun by then.
    pub const fn framing(&self) -> Framing {
        self.framing
    }

    /// Returns whether the unit is in listen-only mode (V1.1b3 6.8, sub-function 04).
    pub const fn is_listen_only(&self) -> bool {
        self.listen_only
    }

    /// Returns whether `request` (unit address and PDU, without CRC) will be answered, including with an exception.
    /// This takes the same few instructions for every request, while [`decide`](Self::decide) takes longer the more
    /// values there are to check. So the first byte of the reply, the unit address, can be sent before the rest is
    /// decided.
    fn answers(&self, request: &Adu) -> bool {
        self.handling(request) == Handling::Answered
    }

    fn handling(&self, request: &Adu) -> Handling {
        let (unit, function) = (request.get(0), request.get(1));
        let broadcast = unit == BROADCAST;
        if !matches!(function, 1..Function::EXCEPTION) {
            return Handling::Dismissed(Outcome::NoRequest);
        }
        let diagnostics = !broadcast && function == Function::Diagnostics.code();
        if self.listen_only {
            return if diagnostics && Diagnostic::is_restart(request.from(2)) {
                Handling::Silent
            } else {
                Handling::Dismissed(Outcome::NotObeyed)
            };
        }
        if broadcast {
            Handling::Broadcast
        } else if self.diagnostics == Diagnostics::All
            && diagnostics
            && Diagnostic::is_listen_only(request.from(2))
        {
            Handling::Silent
        } else {
            Handling::Answered
        }
    }

    /// Decides the reply to `request` (unit address and PDU, without CRC). Everything that can be rejected is
    /// rejected here. Changes nothing.
    fn decide(&self, request: &Adu, model: &impl DataModel) -> Decision {
        let (unit, function) = (request.get(0), request.get(1));
        let broadcast = unit == BROADCAST;
        let silence = |outcome| Decision {
            reply: None,
            work: Work(Job::None),
            outcome,
            broadcast,
        };
        let handling = match self.handling(request) {
            Handling::Dismissed(outcome) => return silence(outcome),
            handling => handling,
        };
        let accepted = accept::accept(self, unit, function, request.from(2), model);
        let (head, work, outcome) = match accepted {
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
            reply: (handling == Handling::Answered).then_some(head),
            work: Work(work),
            outcome,
            broadcast,
        }
    }

    /// Returns all counters as of the last request that was [committed](Answered::commit), less what function 08
    /// has cleared.
    pub const fn counters(&self) -> Counters {
        self.counters_at(&self.line)
    }

    /// Returns all counters with the present counters of the line
    /// ([`Receiver::counters`](crate::line::Receiver::counters)), less what function 08 has cleared. May be called
    /// at any time, also while a request is pending.
    pub const fn counters_at(&self, line: &LineCounters) -> Counters {
        let line = line.since(&self.cleared);
        let tally = &self.tally;
        Counters {
            bus_messages: line.bus_messages,
            communication_errors: line.communication_errors,
            exceptions: tally.exceptions,
            // A dropped frame was a message to this unit and got no reply. It is not part of `busy`, which counts
            // exceptions 06 that were sent (V1.1b3 6.8.1).
            unit_messages: tally.unit_messages.wrapping_add(line.dropped),
            no_response: tally.no_response.wrapping_add(line.dropped),
            nak: tally.nak,
            busy: tally.busy,
            overruns: line.overruns,
            gaps: line.gaps,
        }
    }
}
