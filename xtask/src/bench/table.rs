//! The figures as tables for a terminal.

use serde_json::Value;

use super::figures::{COLUMNS, load_name, over_budget, rows, waits};
use crate::table;

/// Instructions of FreeMODBUS for a whole transaction without a UART driver, measured on a Cortex-M3 when
/// modio was designed: 41 for a byte in; from t3.5 to the first byte 415 (one register), 3400 (125) and 3000 (120
/// written); and 37 for each byte out after that.
const FREEMODBUS: [(&str, u64); 5] = [
    ("03 read holding registers, 1", 8 * 41 + 415 + 6 * 37),
    ("03 read holding registers, 125", 8 * 41 + 3400 + 254 * 37),
    ("04 read input registers, 1", 8 * 41 + 415 + 6 * 37),
    ("04 read input registers, 125", 8 * 41 + 3400 + 254 * 37),
    ("10 write multiple registers, 123", 255 * 41 + 3000 + 7 * 37),
];

const LEGEND: &str = "\
first and second byte: from the expiry of t3.5 until it is in the data register. end: the interrupt that switches the
driver off. in all: the line's interrupts, from the request's first byte to the end; server: of these, without RTIC and
the drivers of UART and timer; FreeMODBUS: the same of this server. The others: from complete frame to complete
response in memory; -: no answer, no such function, or not measured.";

/// Returns the tables of a report.
pub fn of(report: &Value) -> String {
    let mut budgets = String::new();
    for (_, heading, budget) in COLUMNS {
        if let Some(budget) = budget {
            budgets += &format!("{budget} {heading}, ");
        }
    }
    let over = over_budget(report);
    let over: String = over
        .iter()
        .map(|over| format!("\nover budget: {over}"))
        .collect();
    let (requests, load, image) = (requests(report), load(report), image(report));
    format!(
        "{requests}\n{LEGEND}\nbudgets: {budgets}the bytes in RTU mode only\n\n{load}\n\n{image}{over}"
    )
}

fn name(row: &Value, key: &str) -> String {
    row[key].as_str().unwrap_or_default().to_owned()
}

fn number(value: &Value) -> String {
    let value = value.as_u64().map(|value| value.to_string());
    value.unwrap_or_else(|| "-".to_owned())
}

fn requests(report: &Value) -> String {
    let first = rows(report, "requests").next();
    let rivals = first.and_then(|row| row["rivals"].as_object());
    let rivals = rivals.into_iter().flatten().map(|rival| rival.0.as_str());
    let rivals: Vec<&str> = rivals.collect();
    let mut headings = vec!["instructions"];
    headings.extend(COLUMNS.map(|column| column.1));
    headings.push("FreeMODBUS");
    headings.extend(&rivals);
    let rows = rows(report, "requests").map(|row| {
        let mut cells = vec![name(row, "request")];
        cells.extend(COLUMNS.map(|(key, ..)| number(&row[key])));
        let freemodbus = FREEMODBUS.iter().find(|taken| row["request"] == taken.0);
        cells.push(number(&freemodbus.map(|taken| taken.1).into()));
        cells.extend(rivals.iter().map(|rival| number(&row["rivals"][rival])));
        cells
    });
    table::figures(&headings, rows)
}

fn load(report: &Value) -> String {
    let rows = rows(report, "load").map(|row| {
        let longest = waits(row).map(|(task, us)| format!("{task} {us:.1} "));
        let awake = row["awake_percent"].as_f64().unwrap_or_default();
        let (answered, awake) = (number(&row["answered"]), format!("{awake:.1} %"));
        [load_name(row), answered, awake, longest.collect()]
    });
    let first = "requests back to back for a second";
    let last = "longest wait of an interrupt, us";
    table::text(&[first, "answered", "awake", last], rows)
}

fn image(report: &Value) -> String {
    let row = |name: String, row: &Value| [name, number(&row["flash"]), number(&row["ram"])];
    let crates = rows(&report["image"], "crates").map(|taken| row(name(taken, "name"), taken));
    let server = "the server alone, with two buffers".to_owned();
    let sums = [
        row("image".to_owned(), &report["image"]),
        row(server, &report["server"]),
    ];
    table::figures(&["crate", "flash", "RAM"], crates.chain(sums))
}
