//! What was found: lines for people, JUnit XML and JSON for machines.

use std::fmt;
use std::time::Duration;

use serde_json::{Value, json};

use crate::case::Kind;
use crate::hil::about::About;
use crate::hil::timing::Tally;
use crate::report::junit::{self, Test};
use crate::report::{Totals, json as suite_json};
use crate::run::{Outcome, Verdict};

/// Something that was tried beside the suite.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// What it is about, a slash, what was tried.
    pub name: String,
    /// What must be so.
    pub about: String,
    /// What was measured on the way, if anything.
    pub note: String,
    /// How it ended.
    pub verdict: Verdict,
    /// How long it took.
    pub time: Duration,
}

/// All that was found.
#[derive(Clone, Default)]
pub struct Report {
    /// What was tested, with what, where and when.
    pub about: About,
    /// What the unit was tested through.
    pub endpoint: String,
    /// The cases of the suite.
    pub outcomes: Vec<Outcome>,
    /// The requests at each rate.
    pub timing: Vec<Tally>,
    /// Rates, wires and pulses.
    pub findings: Vec<Finding>,
    /// Whether it ended early because somebody wanted so.
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
    /// How many ended how, of everything.
    #[must_use]
    pub fn totals(&self) -> Totals {
        let mut totals = Totals::of(&self.outcomes);
        for finding in &self.findings {
            totals.count(&finding.verdict);
        }
        totals
    }

    /// The names of what failed.
    pub fn failed(&self) -> impl Iterator<Item = &str> {
        let cases = self.outcomes.iter().map(|o| (o.case.name, &o.verdict));
        let findings = self.findings.iter().map(|f| (f.name.as_str(), &f.verdict));
        cases
            .chain(findings)
            .filter(|(_, verdict)| matches!(verdict, Verdict::Failed(_)))
            .map(|(name, _)| name)
    }

    /// A JUnit document: a suite for the cases and one for the rest.
    #[must_use]
    pub fn junit(&self) -> String {
        let rest: Vec<Test<'_>> = self
            .findings
            .iter()
            .map(|finding| Test {
                name: &finding.name,
                section: "hil",
                kind: Kind::Modio,
                verdict: &finding.verdict,
                time: finding.time,
                asked_again: 0,
            })
            .collect();
        let suites = [
            (self.endpoint.as_str(), junit::tests(&self.outcomes)),
            ("hil", rest),
        ];
        let mut xml = format!("{}<testsuites>\n", junit::HEADER);
        for (name, tests) in suites.iter().filter(|(_, tests)| !tests.is_empty()) {
            xml += &junit::element(name, &self.about.properties(), tests);
        }
        xml + "</testsuites>\n"
    }

    /// The same and the times in JSON.
    #[must_use]
    pub fn json(&self) -> Value {
        let totals = self.totals();
        let findings: Vec<Value> = self
            .findings
            .iter()
            .map(|finding| {
                let mut value = suite_json::result(&finding.verdict);
                value["name"] = json!(finding.name);
                value["about"] = json!(finding.about);
                value["note"] = json!(finding.note);
                value["seconds"] = json!(finding.time.as_secs_f64());
                value
            })
            .collect();
        json!({
            "about": self.about.json(),
            "endpoint": self.endpoint,
            "interrupted": self.interrupted,
            "passed": totals.passed,
            "failed": totals.failed,
            "skipped": totals.skipped,
            "suite": suite_json::value(&self.endpoint, &self.outcomes),
            "timing": self.timing.iter().map(tally).collect::<Vec<_>>(),
            "hil": findings,
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
