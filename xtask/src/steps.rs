//! Runs the steps of a check to the last, whatever fails on the way, and sums them up.

use std::fmt::Write as _;

use crate::{Failure, Result};

/// How a step ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All it checks holds.
    Passed,
    /// Something does not hold: what.
    Failed(String),
    /// It could not be tried here: why.
    Skipped(String),
}

impl From<Result<()>> for Outcome {
    fn from(result: Result<()>) -> Self {
        match result {
            Ok(()) => Self::Passed,
            Err(failure) => Self::Failed(failure.to_string()),
        }
    }
}

impl Outcome {
    /// The outcome of a step whose tool is missing: failed when `strict`, as in CI.
    #[must_use]
    pub fn missing(what: &Failure, strict: bool) -> Self {
        if strict {
            Self::Failed(what.to_string())
        } else {
            Self::Skipped(what.to_string())
        }
    }
}

/// The steps run so far.
#[derive(Debug, Default)]
pub struct Steps {
    done: Vec<(String, Outcome)>,
}

impl Steps {
    /// Runs a step under its name.
    pub fn run(&mut self, name: &str, step: impl FnOnce() -> Outcome) {
        eprintln!("==> {name}");
        let outcome = step();
        match &outcome {
            Outcome::Passed => {}
            Outcome::Failed(why) => eprintln!("==> {name} failed: {why}"),
            Outcome::Skipped(why) => eprintln!("==> {name} skipped: {why}"),
        }
        self.done.push((name.to_owned(), outcome));
    }

    fn count(&self, is: fn(&Outcome) -> bool) -> usize {
        self.done.iter().filter(|(_, outcome)| is(outcome)).count()
    }

    /// The table of all steps, and the line `N passed, N failed, N skipped` below it.
    #[must_use]
    pub fn summary(&self) -> String {
        let width = self
            .done
            .iter()
            .map(|(name, _)| name.len())
            .max()
            .unwrap_or(0);
        let mut text = String::new();
        for (name, outcome) in &self.done {
            let (state, why) = match outcome {
                Outcome::Passed => ("passed", ""),
                Outcome::Failed(why) => ("FAILED", why.as_str()),
                Outcome::Skipped(why) => ("skipped", why.as_str()),
            };
            let line = format!("{name:<width$}  {state:<7}  {why}");
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{}", line.trim_end());
        }
        let passed = self.count(|outcome| matches!(outcome, Outcome::Passed));
        let failed = self.count(|outcome| matches!(outcome, Outcome::Failed(_)));
        let skipped = self.count(|outcome| matches!(outcome, Outcome::Skipped(_)));
        let _ = write!(text, "{passed} passed, {failed} failed, {skipped} skipped");
        text
    }

    /// Prints the summary.
    ///
    /// # Errors
    ///
    /// When a step failed: the names of those that did.
    pub fn finish(&self) -> Result<()> {
        say!("\n{}", self.summary());
        let failed: Vec<&str> = self
            .done
            .iter()
            .filter(|(_, outcome)| matches!(outcome, Outcome::Failed(_)))
            .map(|(name, _)| name.as_str())
            .collect();
        if failed.is_empty() {
            Ok(())
        } else {
            Err(Failure::new(format!("failed: {}", failed.join(", "))))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_runs_and_is_summed_up() {
        let mut steps = Steps::default();
        let mut ran = 0;
        steps.run("one", || {
            ran += 1;
            Outcome::Passed
        });
        steps.run("two", || Outcome::from(Err(Failure::new("broken"))));
        steps.run("three", || Outcome::Skipped("no Python".to_owned()));
        steps.run("four", || {
            ran += 1;
            Outcome::Passed
        });
        assert_eq!(ran, 2, "a failure stops nothing");
        let expected = "one    passed\n\
                        two    FAILED   broken\n\
                        three  skipped  no Python\n\
                        four   passed\n\
                        2 passed, 1 failed, 1 skipped";
        assert_eq!(steps.summary(), expected);
        assert_eq!(steps.finish().unwrap_err().to_string(), "failed: two");
    }

    #[test]
    fn skipped_steps_are_no_failure() {
        let mut steps = Steps::default();
        steps.run("one", || Outcome::Skipped("no Python".to_owned()));
        assert_eq!(steps.finish(), Ok(()));
    }
}
