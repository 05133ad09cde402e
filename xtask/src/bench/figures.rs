//! The figures of a report: their budgets, and the baseline with which a change is compared.
//!
//! The same image has the same figures, but a different toolchain makes a different image. So each kind of figure has a
//! tolerance, wide enough for two neighbouring releases of rustc.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use fs_err as fs;
use serde_json::{Value, json};

/// The figures of a request: key, heading, and what the design allows for every request: the instructions in a byte's
/// interrupt, with the CRC, and the cycles for which the scan is held off, a millisecond.
pub const COLUMNS: [(&str, &str, Option<f64>); 7] = [
    ("to_first_byte", "first byte", None),
    ("byte_in", "byte in", Some(80.0)),
    ("byte_out", "byte out", Some(80.0)),
    ("reply_end", "end", Some(80.0)),
    ("transaction", "in all", None),
    ("server", "server", None),
    ("scan_held", "scan held", Some(72_000.0)),
];

/// Flash and RAM of the image that runs alone, of the application in a slot, of the loader, and of the server with every
/// function and two buffers: part, memory, and the bytes that the design allows.
const SIZES: [(&str, &str, Option<f64>); 6] = [
    ("image", "flash", None),
    ("image", "ram", None),
    ("slot", "flash", None),
    ("loader", "flash", Some(16_384.0)),
    // Without function 70 at most 9,216.
    ("server", "flash", Some(11_776.0)),
    ("server", "ram", Some(900.0)),
];

/// Times of the loader, in milliseconds, that the design allows at the nominal and at the slow corner: a start, and the
/// check of a new image.
const BOOT: [(&str, [f64; 2]); 2] = [
    ("start_ms", [100.0, 100.0]),
    ("check_ms", [3_000.0, 4_000.0]),
];

/// Interrupts of the line, and the longest time in microseconds that locks and other handlers may delay them, at the
/// nominal and at the slow corner. A character at 921600 bit/s takes 10.8 us.
const LINE_TASKS: [&str; 2] = ["byte", "frame gap"];
const WAIT_US: f64 = 5.0;
const SLOW_WAIT_US: f64 = 8.5;

/// Allowed growth of a figure: in percent of the baseline, and an absolute amount in addition.
const TOLERANCE_PERCENT: f64 = 8.0;
const TOLERANCE: f64 = 4.0;

/// The absolute amount for figures in percent: a thousandth of the processor.
const TOLERANCE_OF_LOAD: f64 = 0.1;

/// The absolute amount for the time for which the scan is held off, in cycles: the longest of several depends on where
/// interrupts fall, and the image of another commit has them elsewhere.
const TOLERANCE_OF_SCAN: f64 = 1_000.0;

/// A figure with its budget, and with the tolerance of its growth if it belongs to the baseline.
struct Figure {
    name: String,
    value: f64,
    budget: Option<f64>,
    tolerance: Option<f64>,
}

/// Returns the rows of a part of a report.
pub fn rows<'a>(report: &'a Value, name: &str) -> impl Iterator<Item = &'a Value> {
    report[name].as_array().into_iter().flatten()
}

/// Returns the tasks of a load with their longest waits, in microseconds.
pub fn waits(row: &Value) -> impl Iterator<Item = (&str, f64)> {
    rows(row, "longest_waits_us").filter_map(|wait| Some((wait[0].as_str()?, wait[1].as_f64()?)))
}

/// Returns the name of a load: the rate, the request, and the corner unless it is the nominal one.
pub fn load_name(row: &Value) -> String {
    let request = row["request"].as_str().unwrap_or_default();
    let slow = row["corner"] == "slow";
    let corner = if slow { ", slow corner" } else { "" };
    format!("{} bit/s, {request}{corner}", row["baud"])
}

fn figures(report: &Value) -> Vec<Figure> {
    let mut figures = Vec::new();
    let mut add = |name: String, value: &Value, budget, tolerance| {
        figures.extend(value.as_f64().map(|value| Figure {
            name,
            value,
            budget,
            tolerance,
        }));
    };
    for row in rows(report, "requests") {
        let request = row["request"].as_str().unwrap_or_default();
        for (key, _, budget) in COLUMNS {
            // In ASCII mode a byte is two characters, and the design has no budget of a byte.
            let free = request.starts_with("ASCII") && key.starts_with("byte");
            let (name, budget) = (format!("{request}: {key}"), budget.filter(|_| !free));
            let budget = row["budgets"][key].as_f64().or(budget);
            let tolerance = if key == "scan_held" {
                TOLERANCE_OF_SCAN
            } else {
                TOLERANCE
            };
            add(name, &row[key], budget, Some(tolerance));
        }
    }
    for row in rows(report, "load") {
        let (load, awake) = (load_name(row), "awake_percent");
        let name = format!("{load}: {awake}");
        add(name, &row[awake], None, Some(TOLERANCE_OF_LOAD));
        let slow = row["corner"] == "slow";
        let most = if slow { SLOW_WAIT_US } else { WAIT_US };
        for (task, us) in waits(row) {
            let of_line = LINE_TASKS.iter().any(|name| task.starts_with(name));
            let name = format!("{load}: wait of {task} in us");
            add(name, &us.into(), of_line.then_some(most), None);
        }
    }
    for row in rows(report, "boot") {
        let corner = row["corner"].as_str().unwrap_or_default();
        for (key, [nominal, slow]) in BOOT {
            let most = if corner == "slow" { slow } else { nominal };
            let name = format!("loader, {corner} corner: {key}");
            add(name, &row[key], Some(most), Some(TOLERANCE));
        }
    }
    for (part, memory, budget) in SIZES {
        let name = format!("{part}: {memory}");
        let budget = report[part]["budget"].as_f64().or(budget);
        add(name, &report[part][memory], budget, Some(TOLERANCE));
    }
    figures
}

/// Returns every figure that is over its budget.
pub fn over_budget(report: &Value) -> Vec<String> {
    let over = |figure: Figure| {
        let (name, value) = (figure.name, figure.value);
        let budget = figure.budget.filter(|budget| value > *budget)?;
        Some(format!("{name} {value:.1}, the budget is {budget}"))
    };
    figures(report).into_iter().filter_map(over).collect()
}

/// Makes the figures of this report the baseline.
pub fn write(file: &Path, report: &Value) -> Result<()> {
    let rounded = |figure: Figure| {
        figure.tolerance?;
        Some((figure.name, (figure.value * 10.0).round() / 10.0))
    };
    let rounded: BTreeMap<_, _> = figures(report).into_iter().filter_map(rounded).collect();
    Ok(fs::write(file, format!("{:#}\n", json!(rounded)))?)
}

/// Compares a report with the baseline. Figures that are worse by more than the tolerance, or no longer measured, are
/// an error.
pub fn compare(file: &Path, report: &Value) -> Result<()> {
    let baseline = serde_json::from_str(&fs::read_to_string(file)?);
    let shown = file.display();
    let mut baseline: BTreeMap<String, f64> = baseline.with_context(|| shown.to_string())?;
    let mut worse = String::new();
    for figure in figures(report) {
        let (name, value) = (figure.name, figure.value);
        if let (Some(before), Some(more)) = (baseline.remove(&name), figure.tolerance)
            && value > before * (1.0 + TOLERANCE_PERCENT / 100.0) + more
        {
            worse += &format!("\n  {name}: {value:.1}, was {before:.1}");
        }
    }
    for name in baseline.keys() {
        worse += &format!("\n  {name}: not measured any more");
    }
    ensure!(
        worse.is_empty(),
        "worse than the baseline {shown} by more than {TOLERANCE_PERCENT} % and {TOLERANCE}; if that is intended, run \
         `cargo xtask bench --bless` with the same --board{worse}"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(first: u32, load: f64, flash: u32) -> Value {
        json!({
            "requests": [{ "request": "03", "to_first_byte": first, "byte_in": 80 }],
            "load": [{ "baud": 9600, "request": "03", "awake_percent": load }],
            "image": { "flash": flash, "ram": 3000 },
        })
    }

    #[test]
    fn growth_beyond_the_tolerance_and_missing_figures_are_worse() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("baseline.json");
        assert!(
            compare(&file, &report(1, 1.0, 1)).is_err(),
            "there is no baseline"
        );
        write(&file, &report(300, 2.0, 30_000)).unwrap();
        compare(&file, &report(328, 2.25, 32_404)).unwrap();
        let error = compare(&file, &report(329, 2.3, 32_405))
            .unwrap_err()
            .to_string();
        let (_, worse) = error
            .split_once("--bless` with the same --board\n")
            .unwrap();
        let expected = [
            "  03: to_first_byte: 329.0, was 300.0",
            "  9600 bit/s, 03: awake_percent: 2.3, was 2.0",
            "  image: flash: 32405.0, was 30000.0",
        ];
        assert_eq!(worse.lines().collect::<Vec<_>>(), expected);
        let mut less = report(300, 2.0, 30_000);
        less["requests"] = json!([]);
        let error = compare(&file, &less).unwrap_err().to_string();
        assert_eq!(error.matches("not measured any more").count(), 2);
    }

    #[test]
    fn exceeded_budgets_are_named() {
        let report = json!({
            "requests": [
                { "request": "03-one", "to_first_byte": 700, "byte_in": 80, "byte_out": 81, "reply_end": 70,
                    "transaction": 2246, "budgets": { "to_first_byte": 700, "transaction": 2245 } },
                { "request": "ASCII: 03 one", "to_first_byte": 801, "byte_in": 81, "scan_held": 72001,
                    "budgets": { "to_first_byte": 800 } },
            ],
            "load": [
                { "baud": 9600, "request": "03 one", "longest_waits_us": [["frame gap", 5.6], ["scan", 50.0]] },
                { "baud": 9600, "request": "03 one", "corner": "slow", "longest_waits_us": [["byte", 8.5]] },
            ],
            "server": { "flash": 9216, "ram": 901 },
        });
        let expected = [
            "03-one: byte_out 81.0, the budget is 80",
            "03-one: transaction 2246.0, the budget is 2245",
            "ASCII: 03 one: to_first_byte 801.0, the budget is 800",
            "ASCII: 03 one: scan_held 72001.0, the budget is 72000",
            "9600 bit/s, 03 one: wait of frame gap in us 5.6, the budget is 5",
            "server: ram 901.0, the budget is 900",
        ];
        assert_eq!(over_budget(&report), expected);
    }
}
