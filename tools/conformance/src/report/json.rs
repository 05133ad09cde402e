//! JSON, for other tools.

use serde_json::{Value, json};

use crate::report::{Report, Totals};
use crate::run::{Outcome, Verdict};

/// Returns the run as a JSON value.
pub fn value(report: &Report) -> Value {
    let totals = Totals::of(&report.outcomes);
    json!({
        "about": report.about,
        "endpoint": report.endpoint,
        "interrupted": report.interrupted,
        "passed": totals.passed,
        "failed": totals.failed,
        "failed_interpretations": totals.failed_interpretations,
        "skipped": totals.skipped,
        "asked_again": totals.asked_again,
        "cases": report.outcomes.iter().map(case).collect::<Vec<_>>(),
    })
}

/// Returns the result of a case, with its reason, as a JSON value.
fn case(outcome: &Outcome) -> Value {
    let mut value = match &outcome.verdict {
        Verdict::Passed => json!({ "result": "passed" }),
        Verdict::Skipped(why) => json!({ "result": "skipped", "reason": why }),
        Verdict::Failed(failure) => json!({
            "result": "failed",
            "sent": failure.sent,
            "came": failure.came,
            "wanted": failure.wanted,
        }),
    };
    value["name"] = json!(outcome.name);
    value["section"] = json!(outcome.case.section);
    value["kind"] = json!(outcome.case.kind.name());
    value["about"] = json!(outcome.case.about);
    value["note"] = json!(outcome.note);
    value["measured"] = outcome.measured.clone();
    value["seconds"] = json!(outcome.time.as_secs_f64());
    value["asked_again"] = json!(outcome.asked_again);
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_has_every_outcome() {
        let value = value(&crate::report::some_report());
        assert_eq!(value["failed"], 1);
        let results: Vec<&str> = value["cases"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(|case| case["result"].as_str())
            .collect();
        assert_eq!(results, ["passed", "skipped", "failed"]);
        assert_eq!(value["cases"][2]["came"], "silence");
    }
}
