//! The errors of the program: one line for the user, and an exit status.

use std::fmt;

/// Reason why a command failed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// The unit answered with an exception.
    #[error("{0}")]
    Refused(String),
    /// The unit, or a gateway, has no time for a request, which it may carry out later.
    #[error("{0}")]
    Busy(String),
    /// The command line, a name, a value or a file is wrong.
    #[error("{0}")]
    Usage(String),
    /// Nothing was received.
    #[error("{0}")]
    NoAnswer(String),
    /// Bytes were received that are not an answer.
    #[error("{0}")]
    Garbled(String),
    /// The serial port or the connection cannot be opened, or was lost.
    #[error("{0}")]
    Port(String),
}

impl Failure {
    /// Returns a failure for a wrong command line, name, value or file.
    pub fn usage(what: impl fmt::Display) -> Self {
        Self::Usage(what.to_string())
    }

    /// Returns the exit status.
    pub const fn status(&self) -> u8 {
        match self {
            Self::Refused(_) | Self::Busy(_) => 1,
            Self::Usage(_) => 2,
            Self::NoAnswer(_) => 3,
            Self::Garbled(_) => 4,
            Self::Port(_) => 5,
        }
    }

    /// Returns whether asking again later can help: the line or the unit failed, not the request.
    pub const fn may_pass(&self) -> bool {
        matches!(
            self,
            Self::NoAnswer(_) | Self::Garbled(_) | Self::Port(_) | Self::Busy(_)
        )
    }

    /// Returns the failure with the present action in front.
    pub fn while_doing(self, what: impl fmt::Display) -> Self {
        self.said(|text| format!("{what}: {text}"))
    }

    /// Returns the failure with what the command has done until then, if there is anything to say.
    pub fn after(self, note: &str) -> Self {
        if note.is_empty() {
            return self;
        }
        self.said(|text| format!("{text}; {note}"))
    }

    fn said(self, said: impl FnOnce(String) -> String) -> Self {
        match self {
            Self::Refused(text) => Self::Refused(said(text)),
            Self::Busy(text) => Self::Busy(said(text)),
            Self::Usage(text) => Self::Usage(said(text)),
            Self::NoAnswer(text) => Self::NoAnswer(said(text)),
            Self::Garbled(text) => Self::Garbled(said(text)),
            Self::Port(text) => Self::Port(said(text)),
        }
    }
}
