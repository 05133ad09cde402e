//! What the server has decided about a request.

use crate::diagnostic::Diagnostic;
use crate::head::Head;
use crate::identification::ReadCode;
use crate::{Exception, Span, Table};

/// The answer to a request, decided but not yet carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decision {
    /// The first bytes of the reply. `None`: silence.
    pub(crate) reply: Option<Head>,
    /// What is left to do, by [`Committed::carry_out`](crate::Committed::carry_out).
    pub work: Work,
    /// How the request fared, for the counters.
    pub outcome: Outcome,
    /// The request was to all units.
    pub(crate) broadcast: bool,
}

impl Decision {
    /// Whether a reply is sent.
    #[inline]
    #[must_use]
    pub const fn is_answered(&self) -> bool {
        self.reply.is_some()
    }
}

/// The second step of serving a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Work(pub(crate) Job);

/// What the second step does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Job {
    /// Nothing.
    None,
    /// Read these bits into the body.
    ReadBits(Table, Span),
    /// Read these words into the body.
    ReadWords(Table, Span),
    /// Write bits; they are packed in the request from byte `from` on.
    WriteBits {
        /// Where to.
        span: Span,
        /// Where they are in the request, counted from the unit address.
        from: u8,
    },
    /// Write words; they are in the request from byte `from` on.
    WriteWords {
        /// Where to.
        span: Span,
        /// Where they are in the request, counted from the unit address.
        from: u8,
    },
    /// Write the word that a mask has made of the one before.
    WriteMasked {
        /// Where to.
        address: u16,
        /// The word.
        value: u16,
    },
    /// Write words as [`WriteWords`](Self::WriteWords) does, then read some into the body.
    WriteThenRead {
        /// Where to write.
        write: Span,
        /// Where the words are in the request, counted from the unit address.
        from: u8,
        /// What to read then.
        read: Span,
    },
    /// Read file records into the body.
    ReadFile,
    /// Write file records; the request is the body.
    WriteFile,
    /// Put the exception status into the body.
    ExceptionStatus,
    /// Do what function 08 asks for.
    Diagnose(Diagnostic),
    /// Put the event counter into the body.
    EventCounter,
    /// Put the event log into the body.
    EventLog,
    /// Put identity and run indicator into the body.
    ServerId,
    /// Put identification objects into the body.
    Identify {
        /// Which.
        code: ReadCode,
        /// The first of them, if it is known.
        object: u8,
    },
    /// Let the model serve a user-defined function.
    Custom,
}

impl Work {
    /// Whether it writes coils or holding registers; file records do not count.
    #[inline]
    #[must_use]
    pub const fn writes(self) -> bool {
        self.0.writes()
    }

    /// What it reads from the model's tables into the reply, if anything.
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

    /// Whether it may be ordered by a broadcast: "necessarily writing commands" (V1.02 2.1). A
    /// request for data is none, even if it writes as well (17), and one unit's diagnostics are no
    /// business of all.
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

/// How a request fared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Outcome {
    /// A function code no request can have (00, 80 and above): silence, counted as unanswered.
    NoRequest,
    /// The unit only listens (function 08, sub-function 04): silence, counted as unanswered.
    NotObeyed,
    /// A broadcast of what only a single unit can be asked for: no effect.
    NoEffect,
    /// Accepted.
    Accepted,
    /// Refused; on a broadcast without saying so.
    Refused(Exception),
}
