//! The figures as tables for a terminal.

use serde_json::Value;

use super::figures::{COLUMNS, load_name, over_budget, rows, waits};
use crate::table;

/// Instructions of FreeMODBUS without RTIC and a UART driver, measured on a Cortex-M3 when modio was designed: from
/// t3.5 to the first byte, and for the whole transaction, with 41 for a byte in and 37 for each byte out after the
/// first. The figure of function 10 is that of 120 registers.
const FREEMODBUS: [(&str, u64, u64); 5] = [
    ("03 read holding registers, 1", 414, 8 * 41 + 414 + 6 * 37),
    (
        "03 read holding registers, 125",
        3390,
        8 * 41 + 3390 + 254 * 37,
    ),
    ("04 read input registers, 1", 414, 8 * 41 + 414 + 6 * 37),
    (
        "04 read input registers, 125",
        3390,
        8 * 41 + 3390 + 254 * 37,
    ),
    (
        "10 write multiple registers, 123",
        3000,
        255 * 41 + 3000 + 7 * 37,
    ),
];

const LEGEND: &str = "\
first byte: from the expiry of t3.5 until it is in the data register. end: the interrupt that switches the driver off.
in all: the line's interrupts, from the request's first byte to the end; server: of these, without RTIC and the drivers
of UART and timer. A figure with a budget of its own: figure/budget. scan held: the longest time for which the request
holds off the scan, in cycles of 72 MHz. FreeMODBUS: without RTIC and a driver. The others: from complete frame to
complete response in memory; -: no answer, no such function, or not measured.";

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
    let (requests, load) = (requests(report), load(report));
    let (boot, image) = (boot(report), image(report));
    format!(
        "{requests}\n{LEGEND}\nbudgets of every row: {budgets}the bytes in RTU mode only\n\n{load}\n\n{boot}\n\n{image}{over}"
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
    headings.extend(["FreeMODBUS: first byte", "in all"]);
    headings.extend(&rivals);
    let rows = rows(report, "requests").map(|row| {
        let mut cells = vec![name(row, "request")];
        cells.extend(COLUMNS.map(|(key, ..)| match row["budgets"][key].as_u64() {
            Some(budget) => format!("{}/{budget}", number(&row[key])),
            None => number(&row[key]),
        }));
        let freemodbus = FREEMODBUS.iter().find(|taken| row["request"] == taken.0);
        cells.push(number(&freemodbus.map(|taken| taken.1).into()));
        cells.push(number(&freemodbus.map(|taken| taken.2).into()));
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

fn boot(report: &Value) -> String {
    let ms = |value: &Value| format!("{:.0} ms", value.as_f64().unwrap_or_default());
    let rows = rows(report, "boot").map(|row| {
        let cells = [ms(&row["start_ms"]), ms(&row["check_ms"])];
        [name(row, "corner"), cells[0].clone(), cells[1].clone()]
    });
    let heading = [
        "loader, corner",
        "power-on to application",
        "check of an image",
    ];
    table::text(&heading, rows)
}

fn image(report: &Value) -> String {
    let row = |name: String, row: &Value| [name, number(&row["flash"]), number(&row["ram"])];
    let crates = rows(&report["image"], "crates").map(|taken| row(name(taken, "name"), taken));
    let server = "the server alone, with two buffers".to_owned();
    let sums = [
        row("image that runs alone".to_owned(), &report["image"]),
        row("application in a slot".to_owned(), &report["slot"]),
        row("loader".to_owned(), &report["loader"]),
        row(server, &report["server"]),
    ];
    table::figures(&["crate", "flash", "RAM"], crates.chain(sums))
}
