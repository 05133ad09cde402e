//! Errors that decide the exit status or the outcome of a step.

use thiserror::Error;

/// A wrong argument or option: exit status 2.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct Usage(String);

/// A tool is missing on this machine: a step of `cargo xtask test` is skipped, unless in CI.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct Missing(String);

/// Returns the error of a wrong argument or option.
pub fn usage(what: impl Into<String>) -> anyhow::Error {
    Usage(what.into()).into()
}

/// Returns the error of a command line as one line, without clap's hints and usage text.
pub fn one_line(error: &clap::Error) -> String {
    let text = error.render().to_string();
    let lines = text.lines().map(str::trim);
    let what: Vec<&str> = lines.take_while(|line| !line.is_empty()).collect();
    what.join(" ").trim_start_matches("error: ").to_owned()
}

/// Returns the error of a missing tool.
pub fn missing(what: impl Into<String>) -> anyhow::Error {
    Missing(what.into()).into()
}
