//! The errors of the program: one line for the user, and an exit status.

use std::fmt;

/// Why a command did not do what was asked.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// The unit answered with an exception.
    #[error("{0}")]
    Refused(String),
    /// The command line, a name, a value or a file is wrong.
    #[error("{0}")]
    Usage(String),
    /// Nothing came back.
    #[error("{0}")]
    NoAnswer(String),
    /// Something came back that is no answer.
    #[error("{0}")]
    Garbled(String),
    /// The serial port or the connection cannot be opened, or was lost.
    #[error("{0}")]
    Port(String),
}

impl Failure {
    /// What is wrong with the command line, a name, a value or a file.
    pub fn usage(what: impl fmt::Display) -> Self {
        Self::Usage(what.to_string())
    }

    /// The exit status.
    #[must_use]
    pub const fn status(&self) -> u8 {
        match self {
            Self::Refused(_) => 1,
            Self::Usage(_) => 2,
            Self::NoAnswer(_) => 3,
            Self::Garbled(_) => 4,
            Self::Port(_) => 5,
        }
    }

    /// Whether asking again later can help: the line or the unit was in trouble, not the question.
    #[must_use]
    pub const fn may_pass(&self) -> bool {
        matches!(self, Self::NoAnswer(_) | Self::Garbled(_) | Self::Port(_))
    }

    /// The same failure, with what was being done in front.
    #[must_use]
    pub fn while_doing(self, what: impl fmt::Display) -> Self {
        let said = |text: String| format!("{what}: {text}");
        match self {
            Self::Refused(text) => Self::Refused(said(text)),
            Self::Usage(text) => Self::Usage(said(text)),
            Self::NoAnswer(text) => Self::NoAnswer(said(text)),
            Self::Garbled(text) => Self::Garbled(said(text)),
            Self::Port(text) => Self::Port(said(text)),
        }
    }
}
