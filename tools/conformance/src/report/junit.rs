//! JUnit XML, as CI services read it.

use std::fmt::Write as _;
use std::time::Duration;

use crate::case::Kind;
use crate::report::asked_again;
use crate::run::{Outcome, Verdict};

/// The first line of a document.
pub const HEADER: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";

/// A test of a JUnit document.
#[derive(Clone, Copy, Debug)]
pub struct Test<'a> {
    /// The name: a group, a slash, and what is tried.
    pub name: &'a str,
    /// The section that the demand comes from.
    pub section: &'a str,
    /// The kind of source that the demand comes from.
    pub kind: Kind,
    /// The verdict.
    pub verdict: &'a Verdict,
    /// The duration.
    pub time: Duration,
    /// Number of due replies that were missing, so that the request was repeated.
    pub asked_again: u32,
}

/// Returns the outcomes as a JUnit document; `suite` is the name of the endpoint.
pub fn document(suite: &str, outcomes: &[Outcome]) -> String {
    format!("{HEADER}{}", element(suite, &[], &tests(outcomes)))
}

/// Returns the outcomes as tests of a JUnit document.
pub fn tests(outcomes: &[Outcome]) -> Vec<Test<'_>> {
    outcomes
        .iter()
        .map(|outcome| Test {
            name: outcome.case.name,
            section: outcome.case.section,
            kind: outcome.case.kind,
            verdict: &outcome.verdict,
            time: outcome.time,
            asked_again: outcome.asked_again,
        })
        .collect()
}

/// Returns one `testsuite` of a document, with properties: names and values.
pub fn element(suite: &str, properties: &[(&str, String)], tests: &[Test<'_>]) -> String {
    let count = |is: fn(&Verdict) -> bool| tests.iter().filter(|test| is(test.verdict)).count();
    let time: Duration = tests.iter().map(|test| test.time).sum();
    let mut xml = String::new();
    // Writing to a String cannot fail.
    let _ = writeln!(
        xml,
        "<testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" skipped=\"{}\" errors=\"0\" time=\"{:.3}\">",
        escaped(suite),
        tests.len(),
        count(|verdict| matches!(verdict, Verdict::Failed(_))),
        count(|verdict| matches!(verdict, Verdict::Skipped(_))),
        time.as_secs_f64()
    );
    if !properties.is_empty() {
        xml.push_str("  <properties>\n");
        for (name, value) in properties {
            let (name, value) = (escaped(name), escaped(value));
            let _ = writeln!(xml, "    <property name=\"{name}\" value=\"{value}\"/>");
        }
        xml.push_str("  </properties>\n");
    }
    for test in tests {
        let (class, name) = test.name.split_once('/').unwrap_or(("", test.name));
        let _ = write!(
            xml,
            "  <testcase classname=\"{}\" name=\"{}\" time=\"{:.3}\"",
            escaped(class),
            escaped(name),
            test.time.as_secs_f64()
        );
        let _ = match test.verdict {
            Verdict::Passed if test.asked_again > 0 => writeln!(
                xml,
                "><system-out>{}</system-out></testcase>",
                asked_again(test.asked_again)
            ),
            Verdict::Passed => writeln!(xml, "/>"),
            Verdict::Skipped(why) => {
                writeln!(xml, "><skipped message=\"{}\"/></testcase>", escaped(why))
            }
            Verdict::Failed(failure) => writeln!(
                xml,
                "><failure type=\"{}\" message=\"{}\">{}: sent {}; came {}</failure></testcase>",
                test.kind.name(),
                escaped(&failure.wanted),
                escaped(test.section),
                escaped(&failure.sent),
                escaped(&failure.came)
            ),
        };
    }
    xml.push_str("</testsuite>\n");
    xml
}

fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            // XML 1.0 has no other control characters.
            control if control.is_control() => out.push(' '),
            other => out.push(other),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn document_counts_the_tests_and_escapes_their_texts() {
        let xml = document("a \"unit\"", &crate::report::some_outcomes());
        assert!(
            xml.contains("name=\"a &quot;unit&quot;\" tests=\"3\" failures=\"1\" skipped=\"1\"")
        );
        assert!(xml.contains("sent 01 03 &lt;&amp;&gt; &quot;x&quot;; came silence"));
        assert!(xml.contains("<skipped message=\"the unit answers 01"));
        let kind = crate::cases::all()[2].kind.name();
        assert!(xml.contains(&format!("<failure type=\"{kind}\" message=\"a reply\">")));
        assert_eq!(xml.matches("<testcase").count(), 3);
        assert_eq!(escaped("a\u{7}b"), "a b");
    }
}
