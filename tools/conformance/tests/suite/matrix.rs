//! Tests a board at every rate and format of the register map, in RTU and in ASCII mode.
//!
//! `cargo xtask matrix` sets `MODIO_MATRIX` and runs every case in each cell. Every other test run includes the cases that
//! depend on rate or format, on the modio-02 and in every third cell: each rate with other formats than the rates beside
//! it. On a board with slots each rate has other modules in them.

use std::env;

use conformance::case::Case;
use conformance::cases::all;
use conformance::endpoint::sim::Fitting;
use conformance::frame::Mode;
use modbus_line::LineFormat;
use rayon::iter::{
    IndexedParallelIterator as _, IntoParallelRefIterator as _, ParallelIterator as _,
};
use register_map::codes::{self, Baud, Format};
use register_map::{Module, Row};

use super::{failed, in_process, line, of, passed};

/// Set to run every case: the name of the board, and a number that moves the modules on by so many rates.
const VARIABLE: &str = "MODIO_MATRIX";

/// Parts of the names of cases that depend on rate or format.
const CHOSEN: [&str; 8] = [
    "timing/",
    "gaps/",
    "damage/",
    "ascii/",
    "fc03/quantity-most",
    "bus/own-echo",
    "framing/no-byte",
    "hurts/",
];

/// Parts of the names of the cases that take longest: they damage each character of a frame in turn, wait for a second
/// each time, or send hundreds of random frames.
pub const LONG: [&str; 7] = [
    "ascii/truncated",
    "ascii/damaged",
    "ascii/gap",
    "hurts/odd-frames",
    "hurts/noise",
    "hurts/restarts",
    "hurts/torn-values",
];

/// Returns the board at each rate, format and mode that can be used together.
fn cells(board: &'static Row, turn: usize) -> Vec<Fitting> {
    let mut cells = Vec::new();
    for (baud, n) in Baud::ALL.iter().zip(turn..) {
        // The modules of a board with several slots differ, and each slot has every module in turn.
        let modules = Module::ALL.into_iter().cycle().skip(n);
        let ports = board.ports().filter(|_| board.fixed.is_empty());
        let slots: Vec<(u8, Module)> = ports.map(|port| port as u8).zip(modules).collect();
        for (format, (_, name)) in Format::ALL.iter().zip(Format::NAMES) {
            for (mode, of_map) in [
                (Mode::Rtu, codes::Mode::Rtu),
                (Mode::Ascii, codes::Mode::Ascii),
            ] {
                if format.suits(of_map) {
                    cells.push(Fitting {
                        line: line(baud.bits_per_second(), name),
                        mode,
                        slots: slots.clone(),
                        ..of(board)
                    });
                }
            }
        }
    }
    cells
}

/// The cases to run. The tours of all rates and formats run only at one rate and format.
fn cases(every: bool, line: LineFormat) -> Vec<Case> {
    let mut cases = all();
    let named = |case: &Case, parts: &[&str]| parts.iter().any(|part| case.name.contains(part));
    if !every {
        cases.retain(|case| named(case, &CHOSEN) && !named(case, &LONG));
    } else if line != LineFormat::default() {
        cases.retain(|case| !named(case, &["settings/every"]));
    }
    cases
}

/// Runs the cases of a cell. Returns a row for each case that failed.
fn failures(cell: &Fitting, every: bool) -> Vec<String> {
    let outcomes = in_process(cell, &cases(every, cell.line));
    let passed = passed(&outcomes);
    let slots: String = cell
        .slots
        .iter()
        .map(|(port, module)| format!(" {port}={module}"))
        .collect();
    let name = format!("{} {} {:?}{slots}", cell.board, cell.line, cell.mode);
    println!("{name}: {passed} passed");
    let least = if every { 140 } else { 12 };
    assert!(passed > least, "{name}: only {passed} cases passed");
    let rows = failed(&outcomes).into_iter();
    rows.map(|row| format!("{name}: {row}")).collect()
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_rate_and_format_conforms() {
    let every_case = env::var(VARIABLE).ok();
    let chosen = every_case.as_deref().unwrap_or("modio-02 0");
    let (board, turn) = chosen.split_once(' ').expect("a board and a number");
    let board = board.parse().expect("a board");
    let cells = cells(board, turn.parse().expect("a number"));
    assert_eq!(cells.len(), Baud::ALL.len() * (4 + 7));
    let every = every_case.is_some();
    let step = if every { 1 } else { 3 };
    let failed: Vec<String> = cells
        .par_iter()
        .step_by(step)
        .flat_map_iter(|cell| failures(cell, every))
        .collect();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}
