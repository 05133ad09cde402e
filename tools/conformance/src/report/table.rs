//! The table on the terminal, and the list of cases.

use crate::case::Case;
use crate::report::{Totals, asked_again};
use crate::run::{Outcome, Verdict};

/// Returns the row of a case, and for a failed case the failure below it.
pub fn row(outcome: &Outcome) -> String {
    let (result, reason) = match &outcome.verdict {
        Verdict::Passed => ("ok", asked_again(outcome.asked_again)),
        Verdict::Skipped(why) => ("skipped", why.clone()),
        Verdict::Failed(_) => ("FAILED", asked_again(outcome.asked_again)),
    };
    let (case, note) = (outcome.case, &outcome.note);
    let seconds = outcome.time.as_secs_f64();
    let line = format!(
        "{:<38} {:<28} {:<8} {:>7.2} s  {reason}{note}",
        outcome.name, case.section, result, seconds
    );
    let line = line.trim_end().to_owned();
    match &outcome.verdict {
        Verdict::Failed(failure) => format!(
            "{line}\n    must be: {} ({})\n    sent:    {}\n    came:    {}\n    wanted:  {}",
            case.about,
            case.kind.name(),
            failure.sent,
            failure.came,
            failure.wanted
        ),
        _ => line,
    }
}

/// Returns the line below the table.
pub fn summary(outcomes: &[Outcome]) -> String {
    let totals = Totals::of(outcomes);
    let again = match asked_again(totals.asked_again) {
        none if none.is_empty() => none,
        again => format!("; {again}"),
    };
    let interpretations = match totals.failed_interpretations {
        0 => String::new(),
        failed => format!("; failed interpretations: {failed}"),
    };
    format!(
        "{} cases: {} passed, {} failed, {} skipped{again}{interpretations}",
        outcomes.len(),
        totals.passed,
        totals.failed,
        totals.skipped
    )
}

/// The start of the page with the cases.
const PAGE: &str = "\
# The cases of the conformance suite

<!-- Written by `cargo run -p conformance -- --list` from the cases in tools/conformance. Change them there. -->

What each case demands, and where the demand is written. [conformance.md](conformance.md) explains the sections, the
kinds and how to run the suite.

| case | section | kind | what must be so |
|---|---|---|---|
";

/// Returns the cases as a page in Markdown, which is the output of `--list` and `docs/conformance-cases.md`.
pub fn list(cases: &[Case]) -> String {
    let mut text = PAGE.to_owned();
    for case in cases {
        let (name, section, about) = (case.name, case.section, case.about);
        text += &format!(
            "| `{name}` | {section} | {} | {about} |\n",
            case.kind.name()
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn row_of_a_failed_case_has_the_whole_failure() {
        let outcomes = crate::report::some_report().outcomes;
        let rows: Vec<String> = outcomes.iter().map(row).collect();
        assert!(rows[0].contains(" ok ") && !rows[0].contains('\n'));
        assert!(rows[1].contains("skipped") && rows[1].ends_with("function 07"));
        for part in ["FAILED", "01 03 <&>", "silence", "a reply"] {
            assert!(rows[2].contains(part), "{}", rows[2]);
        }
        assert_eq!(summary(&outcomes), "3 cases: 1 passed, 1 failed, 1 skipped");
    }
}
