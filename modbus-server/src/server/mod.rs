//! The server: takes requests, returns replies.

mod execute;
mod tally;

use crate::diagnostic::Diagnostic;
use crate::events::EventLog;
use crate::line::Framing;
use crate::{
    Adu, BROADCAST, Counters, DataModel, Exception, Function, LineCounters, Outcome, Reply, Request,
};
pub(crate) use execute::Refusal;
use execute::{Effect, execute};
use tally::{Sent, Tally};

/// The server of one line. It serves the requests that its [`Port`](crate::line::Port) has received, for one data
/// model, with three calls: [`Port::take`](crate::line::Port::take), [`serve`](Self::serve),
/// [`Port::send`](crate::line::Port::send). The server never sees the port, so each call needs only its own lock.
///
/// A port may have several unit addresses ([`UnitSet`](crate::line::UnitSet)). Its reply has the address of the
/// request. For the standard's diagnostics all addresses are one unit: they share counters, event log and
/// listen-only mode. A request to any address is counted, one request puts all addresses into listen-only mode, and
/// one request restarts them. [`Request::unit`] returns the address of a request, so that the caller can pass the
/// server a model that depends on the address.
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
    /// The last reply, until it is logged.
    sent: Option<Sent>,
}

/// Sub-functions of function 08 that the server executes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Diagnostics {
    /// All of them.
    All,
    /// Those that change nothing. The others are refused.
    ReadOnly,
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
            sent: None,
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

    /// Returns the framing of the next request. The reply to a request that changes it has the framing of that request.
    pub const fn framing(&self) -> Framing {
        self.framing
    }

    /// Returns whether the unit is in listen-only mode (V1.1b3 6.8, sub-function 04).
    pub const fn is_listen_only(&self) -> bool {
        self.listen_only
    }

    /// Serves a request: checks it, executes it, and makes its buffer the reply.
    ///
    /// The reply is logged with the next request, or by [`settle`](Self::settle).
    pub fn serve<'a>(&mut self, request: Request<'a>, model: &mut impl DataModel) -> Reply<'a> {
        let Request { adu, ref line, .. } = request;
        let broadcast = adu.get(0) == BROADCAST;
        let dismissed = self.dismissed(adu);
        let is_answered = !broadcast && dismissed.is_none() && !self.is_silent(adu, model);
        self.begin(line, broadcast, is_answered);
        let executed = match dismissed {
            Some(outcome) => Err(outcome),
            None => execute(self, broadcast, adu, model).map_err(|refusal| refuse(adu, refusal)),
        };
        self.end(executed, is_answered);
        Reply {
            adu,
            is_answered,
            framing: self.framing,
            outcome: executed.map_or_else(|outcome| outcome, |_| Outcome::Accepted),
            writes: executed == Ok(Effect::Written),
        }
    }

    /// Counts a request to this unit and answers it with an exception.
    pub(crate) fn refuse_at_once<'a>(&mut self, request: Request<'a>, why: Exception) -> Reply<'a> {
        self.begin(&request.line, false, true);
        let outcome = refuse(request.adu, why.into());
        self.end(Err(outcome), true);
        Reply {
            adu: request.adu,
            is_answered: true,
            framing: self.framing,
            outcome,
            writes: false,
        }
    }

    /// Returns the outcome of a request that is not executed, whatever the model says.
    #[inline]
    fn dismissed(&self, request: &Adu) -> Option<Outcome> {
        if !matches!(request.get(1), 1..Function::EXCEPTION) {
            Some(Outcome::NoRequest)
        } else if self.listen_only && !is_restart(request) {
            Some(Outcome::NotObeyed)
        } else {
            None
        }
    }

    /// Returns whether a request to this unit is executed without a reply.
    #[inline]
    fn is_silent(&self, request: &Adu, model: &impl DataModel) -> bool {
        self.listen_only
            || (request.get(1) == Function::Diagnostics.code()
                && self.diagnostics == Diagnostics::All
                && Diagnostic::is_listen_only(request.fields())
                && model.has(Function::Diagnostics))
    }

    /// Returns all counters as of the last request that was served, including a request that is being served, less what
    /// function 08 has cleared.
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
            no_response: (tally.no_response)
                .wrapping_add(line.dropped)
                .wrapping_add(line.unsent),
            nak: tally.nak,
            busy: tally.busy,
            overruns: line.overruns,
            gaps: line.gaps,
        }
    }
}

/// Makes a request that is refused an exception.
#[inline(never)]
pub(crate) fn refuse(adu: &mut Adu, refusal: Refusal) -> Outcome {
    let Refusal::Exception(exception) = refusal else {
        return Outcome::NoEffect;
    };
    adu.set(1, adu.get(1) | Function::EXCEPTION);
    adu.truncate(2);
    adu.extend(&[exception.code()]);
    Outcome::Refused(exception)
}

/// Returns whether a request to a unit in listen-only mode is obeyed: only a restart of the communication is.
fn is_restart(request: &Adu) -> bool {
    request.get(0) != BROADCAST
        && request.get(1) == Function::Diagnostics.code()
        && Diagnostic::is_restart(request.fields())
}
