//! JUnit XML, as CI services read it.

use std::fmt::Write as _;
use std::time::Duration;

use crate::report::{Report, Totals, asked_again};
use crate::run::{Outcome, Verdict};

/// Returns the run as a JUnit document. The suite has the name of the endpoint.
pub fn document(report: &Report) -> String {
    let totals = Totals::of(&report.outcomes);
    let time: Duration = report.outcomes.iter().map(|outcome| outcome.time).sum();
    let mut xml = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".to_owned();
    // Writing to a String cannot fail.
    let _ = writeln!(
        xml,
        "<testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" skipped=\"{}\" errors=\"0\" time=\"{:.3}\">",
        escaped(&report.endpoint),
        report.outcomes.len(),
        totals.failed,
        totals.skipped,
        time.as_secs_f64()
    );
    xml.push_str("  <properties>\n");
    for (name, value) in report.about.properties() {
        let (name, value) = (escaped(&name), escaped(&value));
        let _ = writeln!(xml, "    <property name=\"{name}\" value=\"{value}\"/>");
    }
    xml.push_str("  </properties>\n");
    for outcome in &report.outcomes {
        let Outcome { case, name, .. } = outcome;
        let (class, name) = name.split_once('/').unwrap_or(("", name));
        let _ = write!(
            xml,
            "  <testcase classname=\"{}\" name=\"{}\" time=\"{:.3}\"",
            escaped(class),
            escaped(name),
            outcome.time.as_secs_f64()
        );
        let noted = [outcome.note.clone(), asked_again(outcome.asked_again)].join("\n");
        let _ = match &outcome.verdict {
            Verdict::Passed if noted.trim().is_empty() => writeln!(xml, "/>"),
            Verdict::Passed => writeln!(
                xml,
                "><system-out>{}</system-out></testcase>",
                escaped(noted.trim())
            ),
            Verdict::Skipped(why) => {
                writeln!(xml, "><skipped message=\"{}\"/></testcase>", escaped(why))
            }
            Verdict::Failed(failure) => writeln!(
                xml,
                "><failure type=\"{}\" message=\"{}\">{}: sent {}; came {}</failure></testcase>",
                case.kind.name(),
                escaped(&failure.wanted),
                escaped(case.section),
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
            // XML 1.0 does not have most control characters.
            control if control.is_control() && control != '\n' => out.push(' '),
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
        let xml = document(&crate::report::some_report());
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
