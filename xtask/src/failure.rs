//! Why a command did not do what it was asked to.

use std::fmt;

/// What is wrong and what to do about it, in one line, with the exit status.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    what: String,
    /// The exit status of xtask: 1, or 2 for a mistake in what was asked.
    pub code: u8,
}

/// The outcome of a command of xtask.
pub type Result<T> = std::result::Result<T, Failure>;

impl Failure {
    /// Something did not work: exit status 1.
    pub fn new(what: impl Into<String>) -> Self {
        Self {
            what: what.into(),
            code: 1,
        }
    }

    /// Something was asked for that cannot be: exit status 2.
    pub fn asked(what: impl Into<String>) -> Self {
        Self {
            what: what.into(),
            code: 2,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.what)
    }
}

impl std::error::Error for Failure {}
