//! Machine-readable results: JUnit XML of the suites, and a summary of all steps in JSON.

use std::fs;
use std::path::Path;
use std::time::Duration;

use chrono::NaiveDateTime;
use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};
use roxmltree::{Document, Node};
use serde_json::{Value, json};

use super::find::Renode;
use crate::steps::Outcome;
use crate::{Failure, Result};

/// Number of tests with each outcome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) passed: usize,
    pub(super) failed: usize,
    pub(super) skipped: usize,
}

/// Converts the output XML of Robot Framework 6 or 7 to JUnit XML, and counts the tests.
///
/// # Errors
///
/// Returns an error when `from` cannot be read or is not well-formed XML, or when `to` cannot be
/// written.
pub(super) fn robot_to_junit(from: &Path, to: &Path) -> Result<Counts> {
    let text = fs::read_to_string(from).map_err(|error| {
        let from = from.display();
        Failure::new(format!(
            "renode-test left no readable results in {from}: {error}"
        ))
    })?;
    let robot = Document::parse(&text).map_err(|error| {
        let from = from.display();
        Failure::new(format!("renode-test wrote no valid XML to {from}: {error}"))
    })?;
    let tests = robot.descendants().filter(|node| node.has_tag_name("test"));
    let mut suite = TestSuite::new("renode");
    suite.add_test_cases(tests.map(test_case));
    let counts = Counts {
        passed: suite.tests - suite.failures - suite.skipped,
        failed: suite.failures,
        skipped: suite.skipped,
    };
    let mut report = Report::new("renode");
    report.add_test_suite(suite);
    let junit = report
        .to_string()
        .map_err(|error| Failure::new(format!("cannot write {}: {error}", to.display())))?;
    write(to, &junit)?;
    Ok(counts)
}

/// Returns the JUnit test case of a `test` element.
fn test_case(test: Node) -> TestCase {
    // Keywords inside the test have a status, too. Only the direct child is the test's own.
    let status = test.children().find(|node| node.has_tag_name("status"));
    let message = status.and_then(|status| status.text()).unwrap_or_default();
    let outcome = match status.and_then(|status| status.attribute("status")) {
        Some("PASS") => TestCaseStatus::success(),
        Some("SKIP") => {
            let mut skipped = TestCaseStatus::skipped();
            skipped.set_message(message);
            skipped
        }
        _ => {
            let mut failure = TestCaseStatus::non_success(NonSuccessKind::Failure);
            failure.set_description(message);
            failure
        }
    };
    let name = |node: Node| node.attribute("name").unwrap_or_default().to_owned();
    let mut case = TestCase::new(name(test), outcome);
    case.set_classname(test.parent().map(name).unwrap_or_default());
    case.set_time(status.and_then(duration).unwrap_or_default());
    case
}

/// Returns the duration in a `status` element, or `None` when it is missing or unreadable.
///
/// Robot Framework 7 writes the duration in seconds. Robot Framework 6 writes start and end in
/// local time.
fn duration(status: Node) -> Option<Duration> {
    if let Some(seconds) = status.attribute("elapsed") {
        return Duration::try_from_secs_f64(seconds.parse().ok()?).ok();
    }
    let time =
        |name| NaiveDateTime::parse_from_str(status.attribute(name)?, "%Y%m%d %H:%M:%S%.f").ok();
    (time("endtime")? - time("starttime")?).to_std().ok()
}

/// Writes `summary.json`: the version of Renode, and the outcome and duration of every step.
///
/// # Errors
///
/// Returns an error when the file cannot be written.
pub(super) fn summary(
    output: &Path,
    renode: &Renode,
    steps: &[(String, Outcome, Duration)],
) -> Result<()> {
    let steps: Vec<Value> = steps
        .iter()
        .map(|(name, outcome, took)| {
            let (state, why) = match outcome {
                Outcome::Passed => ("passed", ""),
                Outcome::Failed(why) => ("failed", why.as_str()),
                Outcome::Skipped(why) => ("skipped", why.as_str()),
            };
            json!({ "step": name, "outcome": state, "why": why, "seconds": took.as_secs_f64() })
        })
        .collect();
    let text = json!({ "renode": renode.version(), "steps": steps });
    write(&output.join("summary.json"), &format!("{text:#}\n"))
}

fn write(path: &Path, text: &str) -> Result<()> {
    fs::write(path, text)
        .map_err(|error| Failure::new(format!("cannot write {}: {error}", path.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Results of renode/tests/boot.robot from Renode with Robot Framework 6.1, reduced.
    ///
    /// Messages of level TRACE are removed. The test "Tells What It Is" keeps its whole keyword
    /// tree. In the suite and in all other tests, IF, FOR and keywords inside a top-level keyword
    /// are removed. Every suite, test and top-level keyword keeps its status.
    const BOOT: &str = include_str!("testdata/robot_output-boot.xml");

    /// Outcome of a JUnit test case.
    #[derive(Debug, PartialEq, Eq)]
    enum Case {
        Passed,
        Failed(String),
        Skipped(String),
    }

    /// Converts the Robot Framework results `robot` in a temporary directory.
    ///
    /// Returns class name, name, time and outcome of every JUnit test case, and the counts.
    fn convert(robot: &str) -> (Vec<([String; 3], Case)>, Counts) {
        let directory = tempfile::tempdir().unwrap();
        let at = |name| directory.path().join(name);
        fs::write(at("robot_output.xml"), robot).unwrap();
        let counts = robot_to_junit(&at("robot_output.xml"), &at("robot.xml")).unwrap();
        let junit = fs::read_to_string(at("robot.xml")).unwrap();
        let junit = Document::parse(&junit).unwrap();
        for (attribute, count) in [
            ("tests", counts.passed + counts.failed + counts.skipped),
            ("failures", counts.failed),
            ("skipped", counts.skipped),
        ] {
            let total = junit.root_element().attribute(attribute);
            assert_eq!(total, Some(count.to_string().as_str()), "{attribute}");
        }
        let cases = junit
            .descendants()
            .filter(|node| node.has_tag_name("testcase"))
            .map(|case| {
                let outcome = match case.first_element_child() {
                    None => Case::Passed,
                    Some(child) if child.has_tag_name("skipped") => {
                        Case::Skipped(child.attribute("message").unwrap().to_owned())
                    }
                    Some(child) => {
                        assert!(child.has_tag_name("failure"), "{child:?}");
                        Case::Failed(child.text().unwrap().to_owned())
                    }
                };
                let text = |name| case.attribute(name).unwrap().to_owned();
                (["classname", "name", "time"].map(text), outcome)
            })
            .collect();
        (cases, counts)
    }

    /// Returns the JUnit time of a passed test whose status has these `attributes`.
    fn time(attributes: &str) -> String {
        let (cases, _) = convert(&format!(
            r#"<robot><suite name="S"><test name="T"><status status="PASS" {attributes}/></test></suite></robot>"#
        ));
        cases[0].0[2].clone()
    }

    #[test]
    fn boot_results_keep_names_times_and_failure_texts() {
        let first_failure = "InvalidOperationException: Terminal tester failed!

Full report:
([host: 11/22/2026 03:39:25, virt:       0] Attached to UART event: success)
01 03 04 23 83 58 60 3B B7
([host: 11/22/2026 03:39:25, virt:   609.2] Line containing >>01 03 04 23 83 58 60 3B B7<< event: success)

([host: 11/22/2026 03:39:25, virt:   609.2] Line containing regex >>.<< event: failure)";
        let second_failure = "InvalidOperationException: Terminal tester failed!

Full report:
([host: 11/22/2026 03:39:27, virt:       0] Attached to UART event: success)
01 03 02 00 30 B8 50
([host: 11/22/2026 03:39:27, virt:   609.2] Line containing >>01 03 02 00 30 B8 50<< event: success)

([host: 11/22/2026 03:39:27, virt:   609.2] Line containing regex >>.<< event: failure)";
        let failed = |text: &str| Case::Failed(text.to_owned());
        let expected = [
            (
                "Answers Half A Second After Power-On",
                "2.776",
                Case::Passed,
            ),
            ("Tells What It Is", "1.653", failed(first_failure)),
            ("Knows Its Own Number", "0.495", Case::Passed),
            (
                "Tells A Power-On By The Reset Flags",
                "1.447",
                failed(second_failure),
            ),
            ("Counts Its Seconds", "1.485", Case::Passed),
            ("Keeps Quiet While It Starts", "0.545", Case::Passed),
            ("Writes A Log", "0.673", Case::Passed),
            ("Starts Without A Crystal", "2.142", Case::Passed),
        ]
        .map(|(name, time, outcome)| (["Test Suite", name, time].map(str::to_owned), outcome));
        let (cases, counts) = convert(BOOT);
        assert_eq!(cases, expected);
        assert_eq!((counts.passed, counts.failed, counts.skipped), (6, 2, 0));
    }

    #[test]
    fn outcome_is_the_status_of_the_test_not_of_its_keywords() {
        let (cases, counts) = convert(
            r#"<robot><suite name="Boot">
<test name="Passes &quot;immediately&quot;">
<kw name="Expect Error"><kw name="Wait"><status status="FAIL">inner</status></kw><status status="PASS"/></kw>
<status status="PASS"/>
<kw name="Teardown"><status status="SKIP">inner</status></kw>
</test>
<test name="Fails"><kw name="Log"><status status="PASS"/></kw><status status="FAIL">1 &lt; 2 &amp; wrong
twice</status></test>
<test name="Is Skipped"><status status="SKIP">needs "hardware" &gt; 1</status></test>
<status status="FAIL"/>
</suite></robot>"#,
        );
        let outcomes: Vec<_> = cases
            .into_iter()
            .map(|([_, name, _], outcome)| (name, outcome))
            .collect();
        let expected = [
            ("Passes \"immediately\"", Case::Passed),
            ("Fails", Case::Failed("1 < 2 & wrong\ntwice".to_owned())),
            (
                "Is Skipped",
                Case::Skipped("needs \"hardware\" > 1".to_owned()),
            ),
        ]
        .map(|(name, outcome)| (name.to_owned(), outcome));
        assert_eq!(outcomes, expected);
        assert_eq!((counts.passed, counts.failed, counts.skipped), (1, 1, 1));
    }

    #[test]
    fn class_name_is_the_innermost_suite() {
        let (cases, _) = convert(
            r#"<robot><suite name="All">
<suite name="Boot"><test name="A"><status status="PASS"/></test><status status="PASS"/></suite>
<test name="B"><status status="PASS"/></test>
</suite></robot>"#,
        );
        let names: Vec<_> = cases
            .iter()
            .map(|([class, name, _], _)| (class.as_str(), name.as_str()))
            .collect();
        assert_eq!(names, [("Boot", "A"), ("All", "B")]);
    }

    #[test]
    fn time_is_elapsed_or_end_minus_start() {
        assert_eq!(
            time(r#"start="2026-11-22T03:39:21.680000" elapsed="1.5""#),
            "1.500"
        );
        let midnight = r#"starttime="20261231 23:59:59.900" endtime="20270101 00:00:01.025""#;
        assert_eq!(time(midnight), "1.125");
    }

    #[test]
    fn missing_or_unreadable_time_is_zero() {
        for attributes in [
            "",
            r#"elapsed="soon""#,
            r#"elapsed="-1""#,
            r#"endtime="20261122 03:39:21.680""#,
            r#"starttime="20261122 03:39:21.680" endtime="N/A""#,
            r#"starttime="20261122 03:39:21.680" endtime="20261122 02:39:22.680""#,
        ] {
            assert_eq!(time(attributes), "0.000", "{attributes}");
        }
    }

    #[test]
    fn missing_results_are_an_error() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name| directory.path().join(name);
        let failure = robot_to_junit(&at("no.xml"), &at("robot.xml")).unwrap_err();
        assert!(failure.to_string().contains("no.xml"), "{failure}");
    }

    #[test]
    fn damaged_results_are_an_error_that_names_the_file() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name| directory.path().join(name);
        for damaged in ["", "no XML", &BOOT[..BOOT.len() / 2]] {
            fs::write(at("damaged.xml"), damaged).unwrap();
            let failure = robot_to_junit(&at("damaged.xml"), &at("robot.xml")).unwrap_err();
            assert!(failure.to_string().contains("damaged.xml"), "{failure}");
            assert!(!at("robot.xml").exists());
        }
    }

    #[test]
    fn results_without_tests_have_zero_counts() {
        assert_eq!(convert("<robot/>").1, Counts::default());
    }
}
