//! What libFuzzer says of a run.

use std::time::Duration;

/// An input that should not be.
#[derive(Debug, PartialEq, Eq)]
pub struct Finding {
    /// What happened: the panic, or libFuzzer's word for it.
    pub what: String,
    /// Where the input is.
    pub file: String,
}

/// The outcome of a run that found nothing.
pub fn summary(log: &str, time: Duration) -> String {
    // "#1234 DONE   cov: 412 ft: 1633 corp: 301/12Kb ..."
    let done = log.lines().rev().find(|line| line.contains(" cov: "));
    let mut words = done.unwrap_or_default().split_whitespace();
    let executions = words.next().unwrap_or("#?").trim_start_matches('#');
    let mut after = |label: &str| words.by_ref().skip_while(|word| *word != label).nth(1);
    let covered = after("cov:").unwrap_or("?");
    let corpus = after("corp:").and_then(|corpus| corpus.split('/').next());
    format!(
        "{executions} executions in {} s, {covered} places covered, {} inputs, nothing found",
        time.as_secs(),
        corpus.unwrap_or("?")
    )
}

/// What a run found before it ended badly, if it was that.
pub fn finding(log: &str) -> Option<Finding> {
    let file = log
        .lines()
        .find_map(|line| line.split_once("Test unit written to "))?
        .1;
    Some(Finding {
        what: panic(log).or_else(|| error(log)).unwrap_or_default(),
        file: file.trim().to_owned(),
    })
}

/// The message of a panic, up to the backtrace.
fn panic(log: &str) -> Option<String> {
    let from = log
        .lines()
        .skip_while(|line| !line.contains(" panicked at "));
    let message: Vec<&str> = from
        .take_while(|line| !line.starts_with("note: ") && !line.starts_with("stack backtrace"))
        .take_while(|line| !line.starts_with("=="))
        .collect();
    (!message.is_empty()).then(|| message.join("\n"))
}

/// libFuzzer's own: a time-out, or too much memory.
fn error(log: &str) -> Option<String> {
    let line = log.lines().find(|line| line.starts_with("=="))?;
    let (_, what) = line.split_once("ERROR: ")?;
    Some(what.to_owned())
}
