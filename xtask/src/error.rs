//! Errors that decide the exit status or the outcome of a step.

use std::fmt;

/// A wrong argument or option: exit status 2.
#[derive(Debug)]
pub struct Usage(String);

/// Returns the error of a wrong argument or option.
pub fn usage(what: impl Into<String>) -> anyhow::Error {
    Usage(what.into()).into()
}

/// A tool is missing on this machine: a step of `cargo xtask test` is skipped, unless in CI.
#[derive(Debug)]
pub struct Missing(pub String);

impl fmt::Display for Usage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Usage {}
impl std::error::Error for Missing {}
