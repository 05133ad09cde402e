//! JUnit XML, as CI services read it.

use std::time::Duration;

use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};

use crate::case::Kind;
use crate::report::asked_again;
use crate::run::{Outcome, Verdict};

/// Returns the outcomes as a JUnit report; `name` is the name of the endpoint.
#[must_use]
pub fn report(name: &str, outcomes: &[Outcome]) -> Report {
    let mut report = Report::new("modio-conformance");
    report.add_test_suite(suite(name, tests(outcomes)));
    report
}

/// Returns a suite with its time, which is the sum of the times of the tests.
#[must_use]
pub fn suite(name: &str, tests: Vec<TestCase>) -> TestSuite {
    let mut suite = TestSuite::new(name);
    suite.set_time(tests.iter().filter_map(|test| test.time).sum());
    suite.add_test_cases(tests);
    suite
}

/// Returns a test for each outcome.
#[must_use]
pub fn tests(outcomes: &[Outcome]) -> Vec<TestCase> {
    let test = |outcome: &Outcome| {
        let case = outcome.case;
        let mut test = test(
            (case.name, case.section, case.kind),
            &outcome.verdict,
            outcome.time,
        );
        if outcome.verdict == Verdict::Passed && outcome.asked_again > 0 {
            test.set_system_out(asked_again(outcome.asked_again));
        }
        test
    };
    outcomes.iter().map(test).collect()
}

/// Returns a test of this name, with the section and the kind of its demand.
#[must_use]
pub fn test(
    (name, section, kind): (&str, &str, Kind),
    verdict: &Verdict,
    time: Duration,
) -> TestCase {
    let status = match verdict {
        Verdict::Passed => TestCaseStatus::success(),
        Verdict::Skipped(why) => {
            let mut status = TestCaseStatus::skipped();
            status.set_message(why);
            status
        }
        Verdict::Failed(failure) => {
            let mut status = TestCaseStatus::non_success(NonSuccessKind::Failure);
            status.set_type(kind.name());
            status.set_message(&failure.wanted);
            let (sent, came) = (&failure.sent, &failure.came);
            status.set_description(format!("{section}: sent {sent}; came {came}"));
            status
        }
    };
    let (class, name) = name.split_once('/').unwrap_or(("", name));
    let mut test = TestCase::new(name, status);
    test.set_classname(class).set_time(time);
    test
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn report_counts_the_tests_and_shows_why_one_failed_or_was_skipped() {
        let outcomes = crate::report::some_outcomes();
        let xml = report("a \"unit\"", &outcomes).to_string().unwrap();
        for part in [
            "name=\"a &quot;unit&quot;\" tests=\"3\" skipped=\"1\" errors=\"0\" failures=\"1\" time=\"3.750\"",
            "sent 01 03 &lt;&amp;&gt; &quot;x&quot;; came silence",
            "<skipped message=\"the unit answers 01",
            "<failure message=\"a reply\" type=\"standard\">",
        ] {
            assert!(xml.contains(part), "{part}: {xml}");
        }
        assert_eq!(xml.matches("<testcase").count(), 3);
    }
}
