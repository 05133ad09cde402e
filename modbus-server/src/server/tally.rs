//! Counters and event log of the requests (V1.1b3 6.8 to 6.10).

use super::{Effect, Server};
use crate::counters::count;
use crate::diagnostic::Diagnostic;
use crate::events::{Event, EventLog};
use crate::{Exception, LineCounters, Outcome};

/// The server's own counters.
#[derive(Debug)]
pub(super) struct Tally {
    pub(super) exceptions: u16,
    pub(super) unit_messages: u16,
    pub(super) no_response: u16,
    pub(super) nak: u16,
    pub(super) busy: u16,
    /// The event counter of function 0B.
    pub(super) events: u16,
}

/// The event of a reply, and whether the event counter counts the request.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sent {
    event: Event,
    counts: bool,
}

impl Tally {
    pub(super) const ZERO: Self = Self {
        exceptions: 0,
        unit_messages: 0,
        no_response: 0,
        nak: 0,
        busy: 0,
        events: 0,
    };
}

impl Server {
    /// Counts and logs a request, with the line's counters when it was taken, before it is executed.
    ///
    /// Requests are served in the order in which the receiver has received them.
    #[inline(never)]
    pub(super) fn begin(&mut self, line: &LineCounters, broadcast: bool, is_answered: bool) {
        self.settle();
        self.note_line(line);
        self.log.push(Event::received(broadcast, self.listen_only));
        count(&mut self.tally.unit_messages);
        if !is_answered {
            count(&mut self.tally.no_response);
        }
    }

    /// Logs the last reply. The next request would do this, before its own reply begins; call this when that reply has
    /// begun, to make the next one begin sooner.
    #[inline]
    pub fn settle(&mut self) {
        if let Some(sent) = self.sent.take() {
            self.log_sent(sent);
        }
    }

    #[inline(never)]
    fn log_sent(&mut self, Sent { event, counts }: Sent) {
        if counts {
            count(&mut self.tally.events);
        }
        self.log.push(event);
    }

    /// Stores the line's counters, and logs the damaged frames since the last request.
    /// Private, because with a copy older than the last one the differences would wrap: while a request is pending,
    /// its copy is older than the receiver's counters.
    fn note_line(&mut self, line: &LineCounters) {
        let seen = &self.line;
        let errors = line
            .communication_errors
            .wrapping_sub(seen.communication_errors);
        if errors != 0 {
            let overruns = line.overruns.wrapping_sub(seen.overruns);
            for n in 0..errors.min(EventLog::CAPACITY as u16) {
                self.log.push(Event::faulty(n < overruns, self.listen_only));
            }
        }
        self.line = *line;
    }

    /// Ends a request: counts an exception, and executes what must happen after the request.
    #[inline]
    pub(super) fn end(&mut self, executed: Result<Effect, Outcome>, is_answered: bool) {
        // "Not incremented for exception responses, poll commands, or fetch event counter commands" (6.9). Reading the
        // log counts as such a command, because it returns the same count as function 0B (6.10).
        let counts = executed.is_ok_and(|effect| effect != Effect::Polled);
        let exception = match executed {
            Err(Outcome::Refused(exception)) => self.count_exception(exception, is_answered),
            _ => None,
        };
        let event = Event::sent(exception, self.listen_only);
        self.sent = Some(Sent { event, counts });
        if let Ok(Effect::Diagnosed(diagnostic)) = executed {
            self.settle();
            self.finish(diagnostic);
        }
    }

    /// Counts an exception. Returns it if it is sent.
    #[cold]
    #[inline(never)]
    fn count_exception(&mut self, exception: Exception, is_answered: bool) -> Option<Exception> {
        let tally = &mut self.tally;
        count(&mut tally.exceptions);
        if !is_answered {
            return None;
        }
        match exception {
            Exception::NegativeAcknowledge => count(&mut tally.nak),
            Exception::ServerDeviceBusy => count(&mut tally.busy),
            _ => {}
        }
        Some(exception)
    }

    /// Executes what must happen after the reply of function 08.
    #[inline(never)]
    fn finish(&mut self, diagnostic: Diagnostic) {
        match diagnostic {
            Diagnostic::Restart { clear_log } => {
                self.listen_only = false;
                self.framing = self.framing.restarted();
                self.clear();
                if clear_log {
                    self.log.clear();
                }
                self.log.push(Event::RESTARTED);
            }
            Diagnostic::Delimiter(delimiter) => self.framing = self.framing.ending_with(delimiter),
            Diagnostic::ListenOnly => {
                self.listen_only = true;
                self.log.push(Event::LISTEN_ONLY);
            }
            Diagnostic::Clear => self.clear(),
            Diagnostic::ClearOverruns => self.cleared.overruns = self.line.overruns,
            Diagnostic::Echo | Diagnostic::Register | Diagnostic::Counter(_) => {}
        }
    }

    /// Sets all counters to zero.
    fn clear(&mut self) {
        self.tally = Tally::ZERO;
        self.cleared = self.line;
    }
}
