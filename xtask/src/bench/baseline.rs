//! The baseline: the figures that a change must not make much worse.
//!
//! The same image gives the same figures, but not every toolchain the same image. So each kind of figure
//! has a tolerance, wide enough for two neighbouring releases of rustc.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::{Failure, Result};

/// By how much a figure may grow: in percent of the baseline, and by as many more.
const TOLERANCE_PERCENT: f64 = 8.0;
const TOLERANCE: f64 = 4.0;

/// As many more for what is in percent itself: a thousandth of the processor.
const TOLERANCE_OF_LOAD: f64 = 0.1;

fn more(name: &str) -> f64 {
    if name.ends_with(LOAD) {
        TOLERANCE_OF_LOAD
    } else {
        TOLERANCE
    }
}

/// What a load is named in the report, and its figure at the end of its name.
const LOAD: &str = "awake_percent";

/// Figures by their names.
type Figures = BTreeMap<String, f64>;

/// The figures of a report that are held.
fn figures(report: &Value) -> Figures {
    let mut figures = Figures::new();
    let rows = |name: &str| report[name].as_array().into_iter().flatten();
    for row in rows("requests") {
        let request = row["request"].as_str().unwrap_or_default();
        for kind in [
            "to_first_byte",
            "to_second_byte",
            "transaction",
            "server",
            "byte_in",
            "byte_out",
            "reply_end",
        ] {
            if let Some(value) = row[kind].as_f64() {
                figures.insert(format!("{request}: {kind}"), value);
            }
        }
    }
    for row in rows("load") {
        if let Some(value) = row[LOAD].as_f64() {
            figures.insert(format!("{}: {LOAD}", super::table::load_name(row)), value);
        }
    }
    for part in ["image", "server"] {
        for kind in ["flash", "ram"] {
            if let Some(value) = report[part][kind].as_f64() {
                figures.insert(format!("{part}: {kind}"), value);
            }
        }
    }
    figures
}

/// Makes the figures of this report the baseline.
///
/// # Errors
///
/// When the file cannot be written.
pub fn write(file: &Path, report: &Value) -> Result<()> {
    let figures: BTreeMap<String, f64> = figures(report)
        .into_iter()
        .map(|(name, value)| (name, (value * 10.0).round() / 10.0))
        .collect();
    let mut text = format!("{:#}", serde_json::json!(figures));
    text.push('\n');
    fs::write(file, text)
        .map_err(|error| Failure::new(format!("cannot write {}: {error}", file.display())))
}

/// Holds a report against the baseline.
///
/// # Errors
///
/// The figures that are worse by more than the tolerance, or the file, when there is none.
pub fn hold(file: &Path, report: &Value) -> Result<()> {
    let text = fs::read_to_string(file)
        .map_err(|error| Failure::new(format!("cannot read {}: {error}", file.display())))?;
    let baseline: Figures = serde_json::from_str(&text)
        .map_err(|error| Failure::new(format!("{}: {error}", file.display())))?;
    let worse = compare(&baseline, &figures(report));
    if worse.is_empty() {
        return Ok(());
    }
    Err(Failure::new(format!(
        "worse than the baseline {} by more than {TOLERANCE_PERCENT} % and {TOLERANCE}; if that is meant, \
         `cargo xtask bench --bless` with the same --board\n  {}",
        file.display(),
        worse.join("\n  ")
    )))
}

/// What is worse, or there no more.
fn compare(baseline: &Figures, now: &Figures) -> Vec<String> {
    let mut worse = Vec::new();
    for (name, before) in baseline {
        match now.get(name) {
            None => worse.push(format!("{name}: not measured any more")),
            Some(now) if *now > before * (1.0 + TOLERANCE_PERCENT / 100.0) + more(name) => {
                worse.push(format!("{name}: {now:.1}, was {before:.1}"));
            }
            Some(_) => {}
        }
    }
    worse
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn report(first: u32, flash: u32) -> Value {
        json!({
            "requests": [{ "request": "03", "to_first_byte": first, "transaction": 1000, "byte_in": 80, "byte_out": 70 }],
            "load": [{ "baud": 9600, "request": "03", "awake_percent": 2.0 }],
            "image": { "flash": flash, "ram": 3000 },
        })
    }

    #[test]
    fn what_grows_beyond_the_tolerance_is_told() {
        let before = figures(&report(300, 30_000));
        assert_eq!(before.len(), 7);
        assert_eq!(compare(&before, &figures(&report(328, 32_404))), [""; 0]);
        let worse = compare(&before, &figures(&report(329, 32_405)));
        assert_eq!(
            worse,
            [
                "03: to_first_byte: 329.0, was 300.0",
                "image: flash: 32405.0, was 30000.0"
            ]
        );
    }

    #[test]
    fn a_load_has_a_tolerance_of_its_own() {
        let before = figures(&report(300, 30_000));
        let mut more = report(300, 30_000);
        more["load"][0]["awake_percent"] = json!(2.25);
        assert_eq!(compare(&before, &figures(&more)), [""; 0]);
        more["load"][0]["awake_percent"] = json!(2.3);
        assert_eq!(compare(&before, &figures(&more)).len(), 1);
    }

    #[test]
    fn a_figure_that_is_gone_is_told_and_a_new_one_is_welcome() {
        let mut less = report(300, 30_000);
        less["requests"] = json!([]);
        let (before, after) = (figures(&report(300, 30_000)), figures(&less));
        assert_eq!(compare(&before, &after).len(), 4);
        assert_eq!(compare(&after, &before), [""; 0]);
    }

    #[test]
    fn what_is_written_holds() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("baseline.json");
        let missing = hold(&file, &report(1, 1)).unwrap_err().to_string();
        assert!(missing.contains("cannot read"), "{missing}");
        write(&file, &report(300, 30_000)).unwrap();
        hold(&file, &report(300, 30_000)).unwrap();
        let failure = hold(&file, &report(400, 30_000)).unwrap_err().to_string();
        assert!(
            failure.contains("--bless") && failure.contains("400.0, was 300.0"),
            "{failure}"
        );
    }
}
