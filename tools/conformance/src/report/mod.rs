//! Reports of a run: a table for people, JUnit XML and JSON for machines.

pub mod files;
pub mod json;
pub mod junit;
pub mod table;

use crate::about::About;
use crate::case::Kind;
use crate::run::{Outcome, Verdict};

/// A run, for the reports.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// The circumstances of the run.
    pub about: About,
    /// The name of the endpoint.
    pub endpoint: String,
    /// The results.
    pub outcomes: Vec<Outcome>,
    /// Whether the user ended the run early.
    pub interrupted: bool,
}

/// Number of cases by their result.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Cases that passed.
    pub passed: usize,
    /// Cases that failed.
    pub failed: usize,
    /// Failed cases of the kind interpretation.
    pub failed_interpretations: usize,
    /// Cases that did not apply.
    pub skipped: usize,
    /// Due replies that were missing, so that the request was repeated.
    pub asked_again: u32,
}

impl Totals {
    /// Counts outcomes.
    pub fn of(outcomes: &[Outcome]) -> Self {
        let mut totals = Self::default();
        for outcome in outcomes {
            match &outcome.verdict {
                Verdict::Passed => totals.passed += 1,
                Verdict::Failed(_) => {
                    totals.failed += 1;
                    totals.failed_interpretations +=
                        usize::from(outcome.case.kind == Kind::Interpretation);
                }
                Verdict::Skipped(_) => totals.skipped += 1,
            }
            totals.asked_again += outcome.asked_again;
        }
        totals
    }

    /// Returns the number of failed cases that make the run fail. Interpretations count only when `strict` is set.
    pub const fn counted(&self, strict: bool) -> usize {
        if strict {
            self.failed
        } else {
            self.failed - self.failed_interpretations
        }
    }
}

/// Returns a text with the number of repeated requests; empty when there was none.
fn asked_again(times: u32) -> String {
    match times {
        0 => String::new(),
        1 => "1 reply asked for again".to_owned(),
        _ => format!("{times} replies asked for again"),
    }
}

#[cfg(test)]
fn some_report() -> Report {
    use crate::case::Failure;
    use std::time::Duration;
    let verdicts = [
        Verdict::Passed,
        Verdict::Skipped("the unit answers 01 to function 07".to_owned()),
        Verdict::Failed(Failure {
            sent: "01 03 <&> \"x\"".to_owned(),
            came: "silence".to_owned(),
            wanted: "a reply".to_owned(),
        }),
    ];
    let outcomes = crate::cases::all()
        .into_iter()
        .zip(verdicts)
        .map(|(case, verdict)| Outcome::of(case, verdict, Duration::from_millis(1250), 0));
    Report {
        endpoint: "a \"unit\"".to_owned(),
        outcomes: outcomes.collect(),
        ..Report::default()
    }
}
