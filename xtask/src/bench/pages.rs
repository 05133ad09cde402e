//! Compares the figures on pages and pictures with the baselines of the bench, so that a new baseline also renews the
//! pages.

use std::path::Path;

use fs_err as fs;
use register_map::part::{FLASH_BASE, RAM_BASE};
use serde_json::Value;

use crate::renode::MODIO;

fn read(path: &str) -> String {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    fs::read_to_string(root.join(path)).unwrap()
}

struct Baseline(Value);

impl Baseline {
    fn of(board: &str) -> Self {
        let text = read(&format!("tools/bench/baseline-{board}.json"));
        Self(serde_json::from_str(&text).unwrap())
    }

    fn figure(&self, row: &str, key: &str) -> u64 {
        let name = format!("{row}: {key}");
        self.0[&name]
            .as_f64()
            .unwrap_or_else(|| panic!("no {name:?}")) as u64
    }

    /// Returns the largest number of instructions of the interrupt for a byte in or out, of the rows whose name begins
    /// so or not.
    fn byte(&self, ascii: bool) -> u64 {
        let rows = self.0.as_object().unwrap().iter();
        let bytes = rows.filter(|(name, _)| {
            let byte = name.ends_with(": byte_in") || name.ends_with(": byte_out");
            byte && name.starts_with("ASCII") == ascii
        });
        let bytes = bytes.filter_map(|(_, value)| value.as_f64());
        bytes.map(|value| value as u64).max().unwrap()
    }
}

/// Checks that a page contains these texts.
fn check(page: &str, texts: &[String]) {
    let content = read(page);
    for text in texts {
        assert!(
            content.contains(text),
            "{page} needs the figure of the baseline: {text:?}"
        );
    }
}

/// Writes a number with a comma after the thousands.
fn thousands(number: u64) -> String {
    format!("{},{:03}", number / 1000, number % 1000)
}

#[test]
fn picture_of_a_request_has_the_figures_of_the_baseline() {
    let bench = Baseline::of("modio-02");
    let request = |key| bench.figure("01 read coils, 4", key);
    let byte = request("byte_in").max(request("byte_out"));
    check(
        "docs/images/request.svg",
        &[
            format!(">{} instructions<", request("to_first_byte")),
            format!(">{} instructions for the whole", request("transaction")),
            format!(": {byte} at most for a byte in or out"),
            format!(">{} of the server", request("server")),
            format!(" {} at the end of the reply", request("reply_end")),
        ],
    );
}

#[test]
fn picture_of_the_memory_has_the_sizes_of_the_baselines() {
    for board in MODIO {
        let bench = Baseline::of(board.name);
        let [flash, ram] = ["flash", "ram"].map(|key| bench.figure("image", key));
        let end = u64::from(FLASH_BASE) + flash;
        // The stack is not counted. What a reset keeps is counted, and lies at the end of the RAM.
        let variables = u64::from(RAM_BASE + board.memory.stack) + ram - 512;
        check(
            "docs/images/memory.svg",
            &[
                format!(">{} bytes<", thousands(flash)),
                format!(">0x{end:08X}<"),
                format!(">0x{variables:08X}<"),
            ],
        );
    }
}

#[test]
fn costs_of_the_server_are_those_of_the_baseline() {
    let bench = Baseline::of("modio-02");
    let first = |row| bench.figure(row, "to_first_byte");
    let kib = bench.figure("server", "flash") as f64 / 1024.0;
    check(
        "modbus-server/README.md",
        &[
            format!("| flash | {kib:.1} KiB |"),
            format!("| {} bytes: server", bench.figure("server", "ram")),
            format!(
                "| {} instructions, RTIC",
                first("03 read holding registers, 1")
            ),
            format!(
                "| {} instructions |",
                first("03 read holding registers, 125")
            ),
            format!("RTU | at most {} instructions", bench.byte(false)),
            format!("ASCII | at most {} instructions", bench.byte(true)),
        ],
    );
}
