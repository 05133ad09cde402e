//! The results: lines for people, JUnit XML and JSON for machines.

use std::fmt;
use std::time::Duration;

use serde_json::{Value, json};

use crate::about::About;
use crate::timing::Tally;
use conformance::case::Kind;
use conformance::report::junit::{self, Test};
use conformance::report::{Totals, json as suite_json};
use conformance::run::{Outcome, Verdict};

/// The result of a test outside the suite.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// What was tested: a group, a slash, a name.
    pub name: String,
    /// The demand.
    pub about: String,
    /// A measurement, if there is one.
    pub note: String,
    /// The verdict.
    pub verdict: Verdict,
    /// The duration.
    pub time: Duration,
}

/// All results.
#[derive(Clone, Default)]
pub struct Report {
    /// The circumstances of the run.
    pub about: About,
    /// The name of the endpoint.
    pub endpoint: String,
    /// The cases of the suite.
    pub outcomes: Vec<Outcome>,
    /// The requests at each rate.
    pub timing: Vec<Tally>,
    /// Rates, wires and pulses.
    pub findings: Vec<Finding>,
    /// Whether the user ended the run early.
    pub interrupted: bool,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.verdict {
            Verdict::Passed => write!(f, "{}: ok  {}", self.name, self.note),
            Verdict::Skipped(why) => write!(f, "{}: skipped  {why}", self.name),
            Verdict::Failed(failure) => write!(
                f,
                "{}: FAILED\n    must be: {}\n    sent:    {}\n    came:    {}\n    wanted:  {}",
                self.name, self.about, failure.sent, failure.came, failure.wanted
            ),
        }
    }
}

impl Report {
    /// Counts the results of the cases and of the other tests.
    pub fn totals(&self) -> Totals {
        let mut totals = Totals::of(&self.outcomes);
        for finding in &self.findings {
            totals.count(&finding.verdict);
        }
        totals
    }

    /// Returns the names of the cases and tests that failed.
    pub fn failed(&self) -> impl Iterator<Item = &str> {
        let cases = self.outcomes.iter().map(|o| (o.case.name, &o.verdict));
        let findings = self.findings.iter().map(|f| (f.name.as_str(), &f.verdict));
        let has_failed = |verdict: &Verdict| matches!(verdict, Verdict::Failed(_));
        let all = cases.chain(findings);
        all.filter_map(move |(name, verdict)| has_failed(verdict).then_some(name))
    }

    /// Returns a JUnit document: a suite for the cases and one for the other tests.
    pub fn junit(&self) -> String {
        let tests = self.findings.iter().map(|finding| Test {
            name: &finding.name,
            section: "hil",
            kind: Kind::Modio,
            verdict: &finding.verdict,
            time: finding.time,
            asked_again: 0,
        });
        let suites = [
            (self.endpoint.as_str(), junit::tests(&self.outcomes)),
            ("hil", tests.collect()),
        ];
        let mut xml = format!("{}<testsuites>\n", junit::HEADER);
        for (name, tests) in suites.iter().filter(|(_, tests)| !tests.is_empty()) {
            xml += &junit::element(name, &self.about.properties(), tests);
        }
        xml + "</testsuites>\n"
    }

    /// Returns the results, and the times of the requests at each rate, in JSON.
    pub fn json(&self) -> Value {
        let totals = self.totals();
        let findings = self.findings.iter().map(|finding| {
            let mut value = suite_json::result(&finding.verdict);
            value["name"] = json!(finding.name);
            value["about"] = json!(finding.about);
            value["note"] = json!(finding.note);
            value["seconds"] = json!(finding.time.as_secs_f64());
            value
        });
        json!({
            "about": self.about.json(),
            "endpoint": self.endpoint,
            "interrupted": self.interrupted,
            "passed": totals.passed,
            "failed": totals.failed,
            "skipped": totals.skipped,
            "suite": suite_json::value(&self.endpoint, &self.outcomes),
            "timing": self.timing.iter().map(tally).collect::<Vec<_>>(),
            "hil": findings.collect::<Vec<_>>(),
        })
    }
}

fn tally(tally: &Tally) -> Value {
    let turnaround = tally.spread.as_ref().map(|spread| {
        let us = |percent| spread.percentile(percent).as_micros() as u64;
        json!({
            "min": us(0), "median": us(50), "p95": us(95), "p99": us(99), "max": us(100),
        })
    });
    json!({
        "line": tally.line.to_string(),
        "baud": tally.line.baud,
        "sent": tally.sent,
        "lost": tally.lost,
        "wrong": tally.wrong,
        "turnaround_us": turnaround,
        "t35_us": tally.line.t35().as_micros() as u64,
    })
}
