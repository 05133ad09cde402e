//! JSON, for other tools.

use serde_json::{Value, json};

use crate::report::Totals;
use crate::run::{Outcome, Verdict};

/// Returns the outcomes as a JSON value; `endpoint` is the name of the endpoint.
pub fn value(endpoint: &str, outcomes: &[Outcome]) -> Value {
    let totals = Totals::of(outcomes);
    let cases: Vec<Value> = outcomes
        .iter()
        .map(|outcome| {
            let mut value = result(&outcome.verdict);
            value["name"] = json!(outcome.case.name);
            value["section"] = json!(outcome.case.section);
            value["kind"] = json!(outcome.case.kind.name());
            value["about"] = json!(outcome.case.about);
            value["seconds"] = json!(outcome.time.as_secs_f64());
            value["asked_again"] = json!(outcome.asked_again);
            value
        })
        .collect();
    json!({
        "endpoint": endpoint,
        "passed": totals.passed,
        "failed": totals.failed,
        "failed_interpretations": totals.failed_interpretations,
        "skipped": totals.skipped,
        "asked_again": totals.asked_again,
        "cases": cases,
    })
}

/// Returns a verdict and its reason as a JSON value.
pub fn result(verdict: &Verdict) -> Value {
    match verdict {
        Verdict::Passed => json!({ "result": "passed" }),
        Verdict::Skipped(why) => json!({ "result": "skipped", "reason": why }),
        Verdict::Failed(failure) => json!({
            "result": "failed",
            "sent": failure.sent,
            "came": failure.came,
            "wanted": failure.wanted,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_has_every_outcome() {
        let value = value("somewhere", &crate::report::some_outcomes());
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
