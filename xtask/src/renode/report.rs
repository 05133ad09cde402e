//! What is left for machines to read: JUnit XML of the suites, and a summary in JSON.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use super::find::Renode;
use crate::steps::Outcome;
use crate::{Failure, Result};

/// How many tests ended how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) passed: usize,
    pub(super) failed: usize,
    pub(super) skipped: usize,
}

/// Turns Robot Framework's results into JUnit's, and counts them.
///
/// # Errors
///
/// When there are no results, or JUnit's cannot be written.
pub(super) fn robot_to_junit(from: &Path, to: &Path) -> Result<Counts> {
    let text = fs::read_to_string(from)
        .map_err(|_| Failure::new(format!("renode-test left no {}", from.display())))?;
    let (document, counts) = junit(&text);
    write(to, &document)?;
    Ok(counts)
}

/// JUnit XML of what Robot Framework's output has, whose texts are escaped alike.
fn junit(robot: &str) -> (String, Counts) {
    let mut counts = Counts::default();
    let mut cases = String::new();
    let mut suite = "";
    let mut rest = robot;
    while let Some(at) = rest.find('<') {
        rest = &rest[at..];
        if rest.starts_with("<suite ") {
            suite = attribute(rest, "name").unwrap_or_default();
        }
        if rest.starts_with("<test ") {
            let end = rest.find("</test>").unwrap_or(rest.len());
            let (test, after) = rest.split_at(end);
            // The last status is the test's own; those before it are its keywords'.
            let status = test.rfind("<status ").map_or("", |at| &test[at..]);
            let name = attribute(test, "name").unwrap_or_default();
            let seconds = attribute(status, "elapsed").unwrap_or("0");
            let _ = write!(
                cases,
                "  <testcase classname=\"{suite}\" name=\"{name}\" time=\"{seconds}\">"
            );
            match attribute(status, "status") {
                Some("PASS") => counts.passed += 1,
                Some("SKIP") => {
                    counts.skipped += 1;
                    cases.push_str("<skipped/>");
                }
                _ => {
                    counts.failed += 1;
                    let _ = write!(cases, "<failure>{}</failure>", content(status));
                }
            }
            cases.push_str("</testcase>\n");
            rest = after;
        }
        rest = rest.get(1..).unwrap_or_default();
    }
    let Counts {
        passed,
        failed,
        skipped,
    } = counts;
    let total = passed + failed + skipped;
    let document = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <testsuite name=\"renode\" tests=\"{total}\" failures=\"{failed}\" skipped=\"{skipped}\">\n\
         {cases}</testsuite>\n"
    );
    (document, counts)
}

/// An attribute of the tag that `text` begins with.
fn attribute<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    let tag = text.split('>').next()?;
    let (_, value) = tag.split_once(&format!(" {name}=\""))?;
    value.split('"').next()
}

/// What stands between the tag that `text` begins with and the next.
fn content(text: &str) -> &str {
    let after = text.split_once('>').map_or("", |(_, after)| after);
    after.split('<').next().unwrap_or_default()
}

/// Writes `summary.json`: the version of Renode and how every step ended.
///
/// # Errors
///
/// When it cannot be written.
pub(super) fn summary(output: &Path, renode: &Renode, steps: &[(&str, Outcome)]) -> Result<()> {
    let steps: Vec<Value> = steps
        .iter()
        .map(|(name, outcome)| {
            let (state, why) = match outcome {
                Outcome::Passed => ("passed", ""),
                Outcome::Failed(why) => ("failed", why.as_str()),
                Outcome::Skipped(why) => ("skipped", why.as_str()),
            };
            json!({ "step": name, "outcome": state, "why": why })
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

    const ROBOT: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<robot generator="Robot 6.1" rpa="false">
<suite id="s1" name="Boot" source="/x/boot.robot">
<kw name="Setup" type="SETUP"><status status="PASS" starttime="20261121 15:06:36.521"/></kw>
<test id="s1-t1" name="Answers &quot;at once&quot;" line="8">
<kw name="Unit Answers"><status status="FAIL">inner</status></kw>
<status status="PASS" starttime="20261121 15:06:36.521" endtime="20261121 15:06:36.522"/>
</test>
<test id="s1-t2" name="Tells" line="9">
<kw name="Expect"><status status="FAIL">Terminal tester failed!</status></kw>
<status status="FAIL" starttime="x" endtime="y">1 &lt; 2 is
wrong</status>
</test>
<test id="s1-t3" name="Later" line="10"><status status="SKIP" elapsed="1.5"/></test>
<status status="FAIL"/>
</suite>
<statistics><total><stat pass="1" fail="1" skip="1">All Tests</stat></total></statistics>
</robot>"#;

    #[test]
    fn every_test_is_told_by_its_own_status() {
        let (text, counts) = junit(ROBOT);
        assert_eq!(
            counts,
            Counts {
                passed: 1,
                failed: 1,
                skipped: 1
            }
        );
        assert!(
            text.contains("tests=\"3\" failures=\"1\" skipped=\"1\""),
            "{text}"
        );
        let failure = "name=\"Tells\" time=\"0\"><failure>1 &lt; 2 is\nwrong</failure></testcase>";
        assert!(text.contains(failure), "{text}");
        assert!(text.contains(
            "classname=\"Boot\" name=\"Answers &quot;at once&quot;\" time=\"0\"></testcase>"
        ));
        assert!(text.contains("name=\"Later\" time=\"1.5\"><skipped/></testcase>"));
    }

    #[test]
    fn results_that_are_missing_or_none_are_not_a_success() {
        let directory = tempfile::tempdir().unwrap();
        let at = |name| directory.path().join(name);
        assert!(robot_to_junit(&at("no.xml"), &at("junit.xml")).is_err());
        assert_eq!(junit("<robot/>").1, Counts::default());
    }
}
