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
    /// Counts and logs a request, with the line's counters at its end, before it is executed.
    ///
    /// Requests are served in the order in which the receiver has received them.
    pub(super) fn begin(&mut self, line: &LineCounters, broadcast: bool, is_answered: bool) {
        self.note_line(line);
        self.log.push(Event::received(broadcast, self.listen_only));
        count(&mut self.tally.unit_messages);
        if !is_answered {
            count(&mut self.tally.no_response);
        }
    }

    /// Stores the line's counters at the end of a request, and logs the damaged frames before that request.
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

    /// Ends a request: counts its result, logs its reply, and executes what must happen after it.
    pub(super) fn end(&mut self, executed: Result<Effect, Outcome>, is_answered: bool) {
        let tally = &mut self.tally;
        let mut sent = None;
        match executed {
            // "Not incremented for exception responses, poll commands, or fetch event counter commands" (6.9).
            // Reading the log counts as such a command, because it returns the same count as function 0B (6.10).
            Ok(Effect::Polled) => {}
            Ok(_) => count(&mut tally.events),
            Err(Outcome::Refused(exception)) => {
                count(&mut tally.exceptions);
                if is_answered {
                    sent = Some(exception);
                    match exception {
                        Exception::NegativeAcknowledge => count(&mut tally.nak),
                        Exception::ServerDeviceBusy => count(&mut tally.busy),
                        _ => {}
                    }
                }
            }
            Err(_) => {}
        }
        self.log.push(Event::sent(sent, self.listen_only));
        let Ok(Effect::Diagnosed(diagnostic)) = executed else {
            return;
        };
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
