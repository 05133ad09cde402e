//! The figures as tables for a terminal, and their budgets.

use std::fmt::Write as _;

use serde_json::Value;

use crate::table;

/// The columns of a request: key, heading.
pub const COLUMNS: [(&str, &str); 7] = [
    ("to_first_byte", "first byte"),
    ("to_second_byte", "second byte"),
    ("byte_in", "byte in"),
    ("byte_out", "byte out"),
    ("reply_end", "end"),
    ("transaction", "in all"),
    ("server", "server"),
];

/// Instructions that the design allows from t3.5 to the first byte, and for a byte's interrupt in RTU mode, with the
/// CRC. For ASCII mode, where a byte is two characters, the design has no budget of a byte.
const TO_FIRST_BYTE: u64 = 400;
const BYTE: u64 = 80;

/// Bytes of flash and RAM that the design allows the server with every function and two buffers.
const SERVER: [(&str, u64); 2] = [("flash", 9216), ("ram", 900)];

/// Longest time that locks and other handlers may delay an interrupt of the line, in microseconds, at the nominal and
/// at the slow corner, and the tasks of these interrupts. A character at 921600 bit/s takes 10.8 us.
const LINE_WAIT_US: f64 = 5.0;
const SLOW_LINE_WAIT_US: f64 = 8.5;
const LINE_TASKS: [&str; 2] = ["byte", "frame gap"];

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
the drivers of UART and timer. Rivals: from complete frame to complete response in memory; -: no answer, or no such
function.";

/// Returns the tables of a report.
pub fn of(report: &Value) -> String {
    let over = over_budget(report).into_iter();
    let over = over.map(|over| format!("over budget: {over}\n"));
    format!(
        "{}\n{LEGEND}\nbudgets: {TO_FIRST_BYTE} to the first byte, {BYTE} for a byte's interrupt in RTU mode. The \
         server's column for FreeMODBUS:\n{}\n\n{}\n\n{}\n{}",
        requests(report),
        freemodbus(),
        load(report),
        image(report),
        over.collect::<String>()
    )
    .trim_end()
    .to_owned()
}

/// Returns every figure that is over its budget.
pub fn over_budget(report: &Value) -> Vec<String> {
    let mut over = Vec::new();
    for row in rows(report, "requests") {
        let name = row["request"].as_str().unwrap_or_default();
        for (key, heading) in COLUMNS {
            let taken = row[key].as_u64().unwrap_or_default();
            if let Some(budget) = budget(key, name).filter(|budget| taken > *budget) {
                over.push(format!("{name}: {heading} {taken} of {budget}"));
            }
        }
    }
    for row in rows(report, "load") {
        let most = if is_slow(row) {
            SLOW_LINE_WAIT_US
        } else {
            LINE_WAIT_US
        };
        for (task, us) in waits(row) {
            if LINE_TASKS.iter().any(|name| task.starts_with(name)) && us > most {
                over.push(format!(
                    "{}: {task} waits {us:.1} us of {most}",
                    load_name(row)
                ));
            }
        }
    }
    for (kind, budget) in SERVER {
        let taken = report["server"][kind].as_u64().unwrap_or_default();
        if taken > budget {
            over.push(format!("{kind} of the server {taken} of {budget}"));
        }
    }
    over
}

/// Returns the budget of a request in a column, if there is one.
fn budget(key: &str, request: &str) -> Option<u64> {
    match key {
        "to_first_byte" => Some(TO_FIRST_BYTE),
        "byte_in" | "byte_out" if request.starts_with("ASCII") => None,
        "byte_in" | "byte_out" | "reply_end" => Some(BYTE),
        _ => None,
    }
}

/// Returns the rows of a part of a report.
pub fn rows<'a>(report: &'a Value, name: &str) -> impl Iterator<Item = &'a Value> {
    report[name].as_array().into_iter().flatten()
}

/// Returns the tasks of a load with their longest waits, in microseconds.
fn waits(row: &Value) -> impl Iterator<Item = (&str, f64)> {
    rows(row, "longest_waits_us").filter_map(|wait| Some((wait[0].as_str()?, wait[1].as_f64()?)))
}

fn is_slow(row: &Value) -> bool {
    row["corner"] == "slow"
}

/// Returns the name of a load: the rate, the request, and the corner unless it is the nominal one.
pub fn load_name(row: &Value) -> String {
    let request = row["request"].as_str().unwrap_or_default();
    let corner = if is_slow(row) { ", slow corner" } else { "" };
    format!("{} bit/s, {request}{corner}", row["baud"])
}

fn number(value: &Value) -> String {
    let value = value.as_u64();
    value.map_or_else(|| "-".to_owned(), |value| value.to_string())
}

fn requests(report: &Value) -> String {
    let first = rows(report, "requests").next();
    let rivals = first.and_then(|row| row["rivals"].as_object());
    let rivals: Vec<&str> = rivals
        .into_iter()
        .flat_map(|rivals| rivals.keys().map(String::as_str))
        .collect();
    let headings = COLUMNS.map(|(_, heading)| heading);
    let mut table = table::new(
        ["instructions"]
            .into_iter()
            .chain(headings)
            .chain(rivals.clone()),
    );
    table::figures(&mut table);
    for row in rows(report, "requests") {
        let mut cells = vec![row["request"].as_str().unwrap_or_default().to_owned()];
        cells.extend(COLUMNS.map(|(key, _)| number(&row[key])));
        cells.extend(rivals.iter().map(|rival| number(&row["rivals"][rival])));
        table.add_row(cells);
    }
    table::text(&table)
}

fn freemodbus() -> String {
    let mut table = table::new(["FreeMODBUS", "server"]);
    table::figures(&mut table);
    table.add_rows(FREEMODBUS.map(|(request, taken)| [request.to_owned(), taken.to_string()]));
    table::text(&table)
}

fn load(report: &Value) -> String {
    let mut table = table::new([
        "requests back to back for a second",
        "answered",
        "awake",
        "longest wait of an interrupt, us",
    ]);
    for row in rows(report, "load") {
        let mut longest = String::new();
        for (task, us) in waits(row) {
            // Writing to a string cannot fail.
            let _ = write!(longest, "{task} {us:.1} ");
        }
        let awake = row["awake_percent"].as_f64().unwrap_or_default();
        let awake = format!("{awake:.1} %");
        table.add_row([load_name(row), number(&row["answered"]), awake, longest]);
    }
    table::text(&table)
}

fn image(report: &Value) -> String {
    let mut table = table::new(["crate", "flash", "RAM"]);
    table::figures(&mut table);
    let mut add = |name: &str, row: &Value| {
        table.add_row([name.to_owned(), number(&row["flash"]), number(&row["ram"])]);
    };
    for row in rows(&report["image"], "crates") {
        add(row["name"].as_str().unwrap_or_default(), row);
    }
    add("image", &report["image"]);
    add("the server alone, with two buffers", &report["server"]);
    table::text(&table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn figures_rivals_and_exceeded_budgets_are_shown() {
        let report = json!({
            "requests": [
                { "request": "03-one", "to_first_byte": 326, "to_second_byte": 700, "transaction": 2000,
                  "byte_in": 80, "byte_out": 81, "reply_end": 70, "server": 965,
                  "rivals": { "rmodbus": 664, "modbus-core": null } },
                { "request": "ASCII: 03 one", "to_first_byte": 401, "byte_in": 81 },
            ],
            "load": [{ "baud": 9600, "request": "03 one", "answered": 40, "awake_percent": 2.04,
                       "longest_waits_us": [["byte", 0.04], ["frame gap", 5.6], ["scan", 50.0]] }],
            "image": { "flash": 30_000, "ram": 3_000, "crates": [{ "name": "core", "flash": 500, "ram": 0 }] },
            "server": { "flash": 9216, "ram": 901 },
        });
        assert_eq!(
            over_budget(&report),
            [
                "03-one: byte out 81 of 80",
                "ASCII: 03 one: first byte 401 of 400",
                "9600 bit/s, 03 one: frame gap waits 5.6 us of 5",
                "ram of the server 901 of 900",
            ]
        );
        let text = of(&report);
        let row = text
            .lines()
            .find(|line| line.trim().starts_with("03-one"))
            .unwrap();
        let cells: Vec<_> = row.split_whitespace().collect();
        assert_eq!(
            cells[1..],
            ["326", "700", "80", "81", "70", "2000", "965", "-", "664"]
        );
        assert!(text.contains("2.0 %") && text.contains("30000"), "{text}");
    }
}
