//! The figures as tables for a terminal.

use std::fmt::Write as _;

use serde_json::Value;

/// What the design allows: instructions from t3.5 to the first byte, and for a byte's interrupt in RTU
/// mode, the CRC in it. In ASCII mode, where a byte is two characters, it allows nothing in particular.
const TO_FIRST_BYTE: u64 = 400;
const BYTE: u64 = 80;
const ASCII: &str = "ASCII";

/// What it allows the server with every function and two buffers, in bytes of flash and RAM.
const SERVER: [(&str, u64); 2] = [("flash", 9216), ("ram", 900)];

/// How long locks and other handlers may hold off an interrupt of the line, in microseconds, at the nominal and at
/// the slow corner, and the tasks that it is about. A character at 921600 bit/s takes 10.8 us.
const LINE_WAIT_US: f64 = 5.0;
const SLOW_LINE_WAIT_US: f64 = 8.5;
const SLOW: &str = "slow";
const LINE_TASKS: [&str; 2] = ["byte", "frame gap"];

/// The tables of a report.
pub fn of(report: &Value) -> String {
    let mut text = String::new();
    requests(report, &mut text);
    load(report, &mut text);
    image(report, &mut text);
    for over in over_budget(report) {
        line(&mut text, &format!("over budget: {over}"));
    }
    text
}

/// Every figure that is over its budget.
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
        for wait in rows(row, "longest_waits_us") {
            let task = wait[0].as_str().unwrap_or_default();
            let us = wait[1].as_f64().unwrap_or_default();
            let most = if row["corner"] == SLOW {
                SLOW_LINE_WAIT_US
            } else {
                LINE_WAIT_US
            };
            if LINE_TASKS.iter().any(|name| task.starts_with(name)) && us > most {
                let name = load_name(row);
                over.push(format!("{name}: {task} waits {us:.1} us of {most}"));
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

fn rows<'a>(report: &'a Value, name: &str) -> impl Iterator<Item = &'a Value> {
    report[name].as_array().into_iter().flatten()
}

fn line(text: &mut String, cells: &str) {
    // A String takes everything.
    let _ = writeln!(text, "{}", cells.trim_end());
}

/// What FreeMODBUS takes for a whole transaction, without a UART driver, made up of what was measured of it on
/// a Cortex-M3 when modio was designed: 41 for a byte in; from t3.5 to the first byte 415 (one register), 3400
/// (125) and 3000 (120 written); and 37 for each byte out after that.
const FREEMODBUS: [(&str, u64); 5] = [
    ("03 read holding registers, 1", 8 * 41 + 415 + 6 * 37),
    ("03 read holding registers, 125", 8 * 41 + 3400 + 254 * 37),
    ("04 read input registers, 1", 8 * 41 + 415 + 6 * 37),
    ("04 read input registers, 125", 8 * 41 + 3400 + 254 * 37),
    ("10 write multiple registers, 123", 255 * 41 + 3000 + 7 * 37),
];

/// The columns of a request: key, heading.
const COLUMNS: [(&str, &str); 7] = [
    ("to_first_byte", "first byte"),
    ("to_second_byte", "second byte"),
    ("byte_in", "byte in"),
    ("byte_out", "byte out"),
    ("reply_end", "end"),
    ("transaction", "in all"),
    ("server", "server"),
];

/// What a request may take in a column, where there is a budget.
fn budget(key: &str, request: &str) -> Option<u64> {
    match key {
        "to_first_byte" => Some(TO_FIRST_BYTE),
        "byte_in" | "byte_out" if request.starts_with(ASCII) => None,
        "byte_in" | "byte_out" | "reply_end" => Some(BYTE),
        _ => None,
    }
}

fn requests(report: &Value, text: &mut String) {
    let rivals: Vec<&String> = rows(report, "requests")
        .next()
        .and_then(|row| row["rivals"].as_object())
        .map(|rivals| rivals.keys().collect())
        .unwrap_or_default();
    let mut head = format!("{:<42}", "instructions");
    let headings = COLUMNS.iter().map(|(_, heading)| *heading);
    for heading in headings.chain(rivals.iter().map(|rival| rival.as_str())) {
        let _ = write!(head, " {heading:>11}");
    }
    line(text, &head);
    for row in rows(report, "requests") {
        let name = row["request"].as_str().unwrap_or_default();
        let mut cells = format!("{name:<42}");
        for (key, _) in COLUMNS {
            let _ = write!(cells, " {:>11}", number(row[key].as_u64()));
        }
        for rival in &rivals {
            let taken = row["rivals"][rival.as_str()].as_u64();
            let _ = write!(cells, " {:>11}", number(taken));
        }
        line(text, &cells);
    }
    line(
        text,
        "first and second byte: from t3.5's expiry until it is in the data register. end: the driver's switching off.\n\
         in all: the line's interrupts, from the request's first byte to the end; server: of these, without\n\
         RTIC and the drivers of UART and timer. Rivals: from complete frame to complete response in memory;\n\
         -: no answer, or no such function.",
    );
    line(
        text,
        &format!(
            "budgets: {TO_FIRST_BYTE} to the first byte, {BYTE} for a byte's interrupt in RTU mode. The server's column \
             for FreeMODBUS:"
        ),
    );
    for (request, taken) in FREEMODBUS {
        line(text, &format!("  {request:<40} {taken}"));
    }
    line(text, "");
}

fn number(value: Option<u64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| value.to_string())
}

/// The rate, the request, and the corner unless it is the nominal one.
pub fn load_name(row: &Value) -> String {
    let request = row["request"].as_str().unwrap_or_default();
    let corner = if row["corner"] == SLOW {
        ", slow corner"
    } else {
        ""
    };
    format!("{} bit/s, {request}{corner}", row["baud"])
}

fn load(report: &Value, text: &mut String) {
    line(
        text,
        "requests back to back for a second      answered  awake   longest wait of an interrupt, us",
    );
    for row in rows(report, "load") {
        let name = load_name(row);
        let awake = row["awake_percent"].as_f64().unwrap_or_default();
        let answered = number(row["answered"].as_u64());
        let mut cells = format!("{name:<40} {answered:>7} {awake:>5.1} %  ");
        for wait in rows(row, "longest_waits_us") {
            let task = wait[0].as_str().unwrap_or_default();
            let _ = write!(cells, " {task} {:.1}", wait[1].as_f64().unwrap_or_default());
        }
        line(text, &cells);
    }
    line(text, "");
}

fn image(report: &Value, text: &mut String) {
    let image = &report["image"];
    line(
        text,
        "crate                                      flash     RAM",
    );
    for row in rows(image, "crates") {
        let name = row["name"].as_str().unwrap_or_default();
        line(text, &memory(name, row));
    }
    line(text, &memory("image", image));
    let server = &report["server"];
    line(
        text,
        &format!(
            "{}    the server alone, with two buffers",
            memory("modbus_server", server)
        ),
    );
}

fn memory(name: &str, row: &Value) -> String {
    let (flash, ram) = (number(row["flash"].as_u64()), number(row["ram"].as_u64()));
    format!("{name:<40} {flash:>7} {ram:>7}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn figures_budgets_and_rivals_are_shown() {
        let report = json!({
            "requests": [
                { "request": "03 one", "to_first_byte": 326, "to_second_byte": 700, "transaction": 2000, "byte_in": 80, "byte_out": 81, "reply_end": 70,
                  "server": 965, "rivals": { "rmodbus": 664, "modbus-core": null } },
                { "request": "03 read holding registers, 1", "server": 965 },
                { "request": "ASCII: 03 one", "to_first_byte": 401, "byte_in": 81 },
                { "request": "03 read holding registers, 125", "server": 13_127 },
            ],
            "load": [{ "baud": 9600, "request": "03 one", "answered": 40, "awake_percent": 2.04,
                       "longest_waits_us": [["byte", 0.04], ["frame gap", 5.6], ["scan", 50.0]] }],
            "image": { "flash": 30_000, "ram": 3_000, "crates": [{ "name": "core", "flash": 500, "ram": 0 }] },
            "server": { "flash": 9216, "ram": 901 },
        });
        let text = of(&report);
        assert!(
            text.contains("over budget: ram of the server 901 of 900"),
            "{text}"
        );
        assert!(
            text.contains("over budget: 9600 bit/s, 03 one: frame gap waits 5.6 us of 5"),
            "{text}"
        );
        assert!(!text.contains("byte waits") && !text.contains("scan waits"));
        assert!(!text.contains("flash of the server"), "{text}");
        assert!(
            text.contains("over budget: 03 one: byte out 81 of 80"),
            "{text}"
        );
        assert!(!text.contains("byte in 80 of"), "{text}");
        assert!(!text.contains("byte in 81 of"), "{text}");
        assert!(
            text.contains("over budget: ASCII: 03 one: first byte 401 of 400"),
            "{text}"
        );
        let row = text
            .lines()
            .find(|line| line.starts_with("03 one"))
            .unwrap();
        let cells: Vec<_> = row.split_whitespace().collect();
        assert_eq!(
            cells[2..],
            ["326", "700", "80", "81", "70", "2000", "965", "-", "664"]
        );
        assert!(text.contains("2.0 %") && text.contains("30000"), "{text}");
    }
}
