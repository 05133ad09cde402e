//! The result of a step, or a part, of a case.

use std::time::Duration;

use serde_json::Value;

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

/// The result of a part of a case.
#[derive(Clone, Debug)]
pub struct Part {
    /// What was tested, such as a wire.
    pub name: String,
    /// What was measured, for people; it may have several lines.
    pub note: String,
    /// What was measured, for programs.
    pub measured: Value,
    /// The mistake of the unit, if it made one.
    pub result: Result<(), Failure>,
    /// How long it took by the endpoint's clock.
    pub time: Duration,
}
