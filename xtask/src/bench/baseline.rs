//! The baseline: the figures with which a change is compared.
//!
//! The same image has the same figures, but a different toolchain makes a different image. So each kind of figure has a
//! tolerance, wide enough for two neighbouring releases of rustc.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use fs_err as fs;
use serde_json::Value;

use super::table::{COLUMNS, load_name, rows};

/// Allowed growth of a figure: in percent of the baseline, and an absolute amount in addition.
const TOLERANCE_PERCENT: f64 = 8.0;
const TOLERANCE: f64 = 4.0;

/// The amount for figures in percent: a thousandth of the processor.
const TOLERANCE_OF_LOAD: f64 = 0.1;

/// The key of the load in a report, and the end of its figure's name.
const LOAD: &str = "awake_percent";

/// Figures by their names.
type Figures = BTreeMap<String, f64>;

/// Returns the figures of a report that belong to the baseline.
fn figures(report: &Value) -> Figures {
    let mut figures = Figures::new();
    let mut add = |name: &str, row: &Value, key: &str| {
        if let Some(value) = row[key].as_f64() {
            figures.insert(format!("{name}: {key}"), value);
        }
    };
    for row in rows(report, "requests") {
        let request = row["request"].as_str().unwrap_or_default();
        COLUMNS.iter().for_each(|(key, _)| add(request, row, key));
    }
    rows(report, "load").for_each(|row| add(&load_name(row), row, LOAD));
    for part in ["image", "server"] {
        ["flash", "ram"]
            .iter()
            .for_each(|key| add(part, &report[part], key));
    }
    figures
}

/// Makes the figures of this report the baseline.
pub fn write(file: &Path, report: &Value) -> Result<()> {
    let mut figures = figures(report);
    figures
        .values_mut()
        .for_each(|value| *value = (*value * 10.0).round() / 10.0);
    Ok(fs::write(
        file,
        format!("{:#}\n", serde_json::json!(figures)),
    )?)
}

/// Compares a report with the baseline. Figures that are worse by more than the tolerance are an error.
pub fn compare_with(file: &Path, report: &Value) -> Result<()> {
    let baseline = serde_json::from_str(&fs::read_to_string(file)?);
    let baseline = baseline.with_context(|| file.display().to_string())?;
    let worse = compare(&baseline, &figures(report));
    ensure!(
        worse.is_empty(),
        "worse than the baseline {} by more than {TOLERANCE_PERCENT} % and {TOLERANCE}; if that is intended, run \
         `cargo xtask bench --bless` with the same --board\n  {}",
        file.display(),
        worse.join("\n  ")
    );
    Ok(())
}

/// Returns the figures that are worse, or no longer measured.
fn compare(baseline: &Figures, now: &Figures) -> Vec<String> {
    let mut worse = Vec::new();
    for (name, before) in baseline {
        let amount = if name.ends_with(LOAD) {
            TOLERANCE_OF_LOAD
        } else {
            TOLERANCE
        };
        match now.get(name) {
            None => worse.push(format!("{name}: not measured any more")),
            Some(now) if *now > before * (1.0 + TOLERANCE_PERCENT / 100.0) + amount => {
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

    fn report(first: u32, load: f64, flash: u32) -> Value {
        json!({
            "requests": [{ "request": "03", "to_first_byte": first, "byte_in": 80 }],
            "load": [{ "baud": 9600, "request": "03", "awake_percent": load }],
            "image": { "flash": flash, "ram": 3000 },
        })
    }

    #[test]
    fn growth_beyond_the_tolerance_and_missing_figures_are_worse() {
        let before = figures(&report(300, 2.0, 30_000));
        assert_eq!(before.len(), 5);
        let compare = |report| compare(&before, &figures(&report));
        assert_eq!(compare(report(328, 2.25, 32_404)), [""; 0]);
        assert_eq!(
            compare(report(329, 2.3, 32_405)),
            [
                "03: to_first_byte: 329.0, was 300.0",
                "9600 bit/s, 03: awake_percent: 2.3, was 2.0",
                "image: flash: 32405.0, was 30000.0",
            ]
        );
        let mut less = report(300, 2.0, 30_000);
        less["requests"] = json!([]);
        assert_eq!(compare(less).len(), 2);
    }

    #[test]
    fn written_baseline_is_met_by_its_own_report() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("baseline.json");
        let missing = compare_with(&file, &report(1, 1.0, 1)).unwrap_err();
        assert!(missing.to_string().contains("baseline.json"), "{missing}");
        write(&file, &report(300, 2.0, 30_000)).unwrap();
        compare_with(&file, &report(300, 2.0, 30_000)).unwrap();
        let error = compare_with(&file, &report(400, 2.0, 30_000)).unwrap_err();
        assert!(error.to_string().contains("--bless"), "{error}");
    }
}
