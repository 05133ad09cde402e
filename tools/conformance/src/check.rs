//! The result of a step of a case.

use crate::endpoint::Broken;

/// What was sent, what was received, and what should have been received.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// What was sent.
    pub sent: String,
    /// What was received.
    pub came: String,
    /// What should have been received.
    pub wanted: String,
}

/// Why a case stops before its end.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Stop {
    /// The unit made a mistake.
    #[error("sent {}; received {}; expected {}", .0.sent, .0.came, .0.wanted)]
    Fail(Failure),
    /// The case does not apply: the reason, which the case found while it ran.
    #[error("{0}")]
    Skip(String),
    /// The endpoint no longer works.
    #[error(transparent)]
    Broken(#[from] Broken),
}

/// The result of a step of a case.
pub type Check<T = ()> = Result<T, Stop>;

/// Skips the case, for this reason.
///
/// # Errors
///
/// [`Stop::Skip`] always.
pub fn skip<T>(why: impl Into<String>) -> Check<T> {
    Err(Stop::Skip(why.into()))
}
