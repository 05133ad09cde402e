//! JUnit XML, as CI services read it.

use std::fmt::Write as _;

use crate::report::Totals;
use crate::run::{Outcome, Verdict};

/// The outcomes as a JUnit document; `suite` is what was tested.
#[must_use]
pub fn document(suite: &str, outcomes: &[Outcome]) -> String {
    let totals = Totals::of(outcomes);
    let seconds: f64 = outcomes.iter().map(|o| o.time.as_secs_f64()).sum();
    let mut xml = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".to_owned();
    // A String takes everything.
    let _ = writeln!(
        xml,
        "<testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" skipped=\"{}\" errors=\"0\" time=\"{seconds:.3}\">",
        escaped(suite),
        outcomes.len(),
        totals.failed,
        totals.skipped
    );
    for outcome in outcomes {
        let (class, name) = outcome
            .case
            .name
            .split_once('/')
            .unwrap_or(("", outcome.case.name));
        let _ = write!(
            xml,
            "  <testcase classname=\"{}\" name=\"{}\" time=\"{:.3}\"",
            escaped(class),
            escaped(name),
            outcome.time.as_secs_f64()
        );
        let _ = match &outcome.verdict {
            Verdict::Passed => writeln!(xml, "/>"),
            Verdict::Skipped(why) => {
                writeln!(xml, "><skipped message=\"{}\"/></testcase>", escaped(why))
            }
            Verdict::Failed(failure) => writeln!(
                xml,
                "><failure message=\"{}\">{}: sent {}; came {}</failure></testcase>",
                escaped(&failure.wanted),
                escaped(outcome.case.section),
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
    fn it_counts_and_escapes() {
        let xml = document("a \"unit\"", &crate::report::some_outcomes());
        assert!(
            xml.contains("name=\"a &quot;unit&quot;\" tests=\"3\" failures=\"1\" skipped=\"1\"")
        );
        assert!(xml.contains("sent 01 03 &lt;&amp;&gt; &quot;x&quot;; came silence"));
        assert!(xml.contains("<skipped message=\"the unit answers 01"));
        assert_eq!(xml.matches("<testcase").count(), 3);
        assert_eq!(escaped("a\u{7}b"), "a b");
    }
}
