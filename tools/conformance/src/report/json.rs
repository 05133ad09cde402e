//! JSON, for other tools.

use serde_json::{Value, json};

use crate::report::Totals;
use crate::run::{Outcome, Verdict};

/// The outcomes as a JSON value; `endpoint` is what was tested through.
#[must_use]
pub fn value(endpoint: &str, outcomes: &[Outcome]) -> Value {
    let totals = Totals::of(outcomes);
    let cases: Vec<Value> = outcomes
        .iter()
        .map(|outcome| {
            let mut value = json!({
                "name": outcome.case.name,
                "section": outcome.case.section,
                "about": outcome.case.about,
                "seconds": outcome.time.as_secs_f64(),
            });
            match &outcome.verdict {
                Verdict::Passed => value["result"] = json!("passed"),
                Verdict::Skipped(why) => {
                    value["result"] = json!("skipped");
                    value["reason"] = json!(why);
                }
                Verdict::Failed(failure) => {
                    value["result"] = json!("failed");
                    value["sent"] = json!(failure.sent);
                    value["came"] = json!(failure.came);
                    value["wanted"] = json!(failure.wanted);
                }
            }
            value
        })
        .collect();
    json!({
        "endpoint": endpoint,
        "passed": totals.passed,
        "failed": totals.failed,
        "skipped": totals.skipped,
        "cases": cases,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_outcome_is_there() {
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
