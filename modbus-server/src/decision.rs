//! The server's decision about a request.

use crate::diagnostic::Diagnostic;
use crate::head::Head;
use crate::identification::ReadCode;
use crate::{Exception, Span, Table};

/// The answer to a request, decided but not yet executed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decision {
    /// The first bytes of the reply, or `None` for no reply.
    pub(crate) reply: Option<Head>,
    /// The work left for [`Committed::carry_out`](crate::Committed::carry_out).
    pub work: Work,
    /// Result of the request, for the counters.
    pub outcome: Outcome,
    /// The request was a broadcast.
    pub(crate) broadcast: bool,
}

impl Decision {
    /// Returns whether a reply is sent.
    #[inline]
    #[must_use]
    pub const fn is_answered(&self) -> bool {
        self.reply.is_some()
    }
}

/// The second step of serving a request: the work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Work(pub(crate) Job);

/// The kind of work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Job {
    /// No work.
    None,
    /// Read these bits into the body.
    ReadBits(Table, Span),
    /// Read these words into the body.
    ReadWords(Table, Span),
    /// Write bits, which are packed in the request from byte `from` on.
    WriteBits {
        /// Addresses to write.
        span: Span,
        /// Position of the bits in the request, counted from the unit address.
        from: u8,
    },
    /// Write words, which are in the request from byte `from` on.
    WriteWords {
        /// Addresses to write.
        span: Span,
        /// Position of the words in the request, counted from the unit address.
        from: u8,
    },
    /// Write the word that a mask write has computed.
    WriteMasked {
        /// Address to write.
        address: u16,
        /// Value to write.
        value: u16,
    },
    /// Write words like [`WriteWords`](Self::WriteWords), then read words into the body.
    WriteThenRead {
        /// Addresses to write.
        write: Span,
        /// Position of the words in the request, counted from the unit address.
        from: u8,
        /// Addresses to read after the write.
        read: Span,
    },
    /// Read file records into the body.
    ReadFile,
    /// Write file records; the body of the reply is the request.
    WriteFile,
    /// Put the exception status into the body.
    ExceptionStatus,
    /// Execute the sub-function of function 08.
    Diagnose(Diagnostic),
    /// Put the event counter into the body.
    EventCounter,
    /// Put the event log into the body.
    EventLog,
    /// Put the server ID and the run indicator into the body.
    ServerId,
    /// Put identification objects into the body.
    Identify {
        /// The requested kind of objects.
        code: ReadCode,
        /// The first object, if it is known.
        object: u8,
    },
    /// Let the model serve a user-defined function.
    Custom,
}

impl Work {
    /// Returns whether the work writes coils or holding registers. File records do not count.
    #[inline]
    #[must_use]
    pub const fn writes(self) -> bool {
        self.0.writes()
    }

    /// Returns what the work reads from the model's tables into the reply, if anything.
    #[inline]
    #[must_use]
    pub const fn reads(self) -> Option<(Table, Span)> {
        match self.0 {
            Job::ReadBits(table, span) | Job::ReadWords(table, span) => Some((table, span)),
            Job::WriteThenRead { read, .. } => Some((Table::HoldingRegisters, read)),
            _ => None,
        }
    }
}

impl Job {
    #[inline]
    const fn writes(self) -> bool {
        matches!(
            self,
            Self::WriteBits { .. }
                | Self::WriteWords { .. }
                | Self::WriteMasked { .. }
                | Self::WriteThenRead { .. }
        )
    }

    /// Returns whether a broadcast may order this work: only "necessarily writing commands" (V1.02 2.1). A request
    /// for data is not one, even if it also writes (17). The diagnostics of one unit do not concern all units.
    pub(crate) const fn can_be_broadcast(self) -> bool {
        matches!(
            self,
            Self::WriteBits { .. }
                | Self::WriteWords { .. }
                | Self::WriteMasked { .. }
                | Self::WriteFile
        )
    }
}

/// Result of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Outcome {
    /// An invalid function code (00, 80 and above): no reply, counted as unanswered.
    NoRequest,
    /// The unit is in listen-only mode (function 08, sub-function 04): no reply, counted as unanswered.
    NotObeyed,
    /// A broadcast of a function that only a single unit can execute: no effect.
    NoEffect,
    /// Accepted.
    Accepted,
    /// Rejected. A broadcast gets no reply, though.
    Refused(Exception),
}
