//! Tests the image at every rate and format of the register map, in RTU and in ASCII mode.
//!
//! `cargo xtask matrix` sets `MODIO_MATRIX` and runs every case in each cell. Every other test run includes the cases that
//! depend on rate or format, in every third cell: each rate with other formats than the rates beside it. Each rate has
//! another module in the slot.

use std::env;

use conformance::case::Case;
use conformance::cases::all;
use conformance::endpoint::sim::Fitting;
use conformance::frame::Mode;
use modbus_line::LineFormat;
use rayon::iter::{IndexedParallelIterator as _, IntoParallelIterator as _, ParallelIterator as _};
use register_map::Module;
use register_map::codes::{self, Baud, Format};

use super::{failed, in_process, line, modio_02, passed};

/// Set to run every case. Its number moves the modules on by so many rates.
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
const LONG: [&str; 7] = [
    "ascii/truncated",
    "ascii/damaged",
    "ascii/gap",
    "hurts/odd-frames",
    "hurts/noise",
    "hurts/restarts",
    "hurts/torn-values",
];

/// A rate, a format and a mode that can be used together, with the module of the rate.
type Cell = (LineFormat, Mode, Module);

fn cells(turn: usize) -> Vec<Cell> {
    let mut cells = Vec::new();
    for (baud, module) in Baud::ALL
        .iter()
        .zip(Module::ALL.into_iter().cycle().skip(turn))
    {
        for (format, (_, name)) in Format::ALL.iter().zip(Format::NAMES) {
            let line = line(baud.bits_per_second(), name);
            for (mode, of_map) in [
                (Mode::Rtu, codes::Mode::Rtu),
                (Mode::Ascii, codes::Mode::Ascii),
            ] {
                if format.suits(of_map) {
                    cells.push((line, mode, module));
                }
            }
        }
    }
    cells
}

/// The cases to run. The tours of all rates and formats run only at one rate and format.
fn cases(every: bool, (line, ..): Cell) -> Vec<Case> {
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
fn failures(cell: Cell, every: bool) -> Vec<String> {
    let (line, mode, module) = cell;
    let fitting = Fitting {
        line,
        mode,
        ..modio_02(module)
    };
    let outcomes = in_process(&fitting, &cases(every, cell));
    let passed = passed(&outcomes);
    println!("{line} {mode:?} {module}: {passed} passed");
    let least = if every { 140 } else { 12 };
    assert!(passed > least, "{cell:?}: only {passed} cases passed");
    let rows = failed(&outcomes).into_iter();
    rows.map(|row| format!("{line} {mode:?} {module}: {row}"))
        .collect()
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_rate_and_format_conforms() {
    let turn = env::var(VARIABLE).ok();
    let every = turn.is_some();
    let cells = cells(turn.map_or(0, |turn| turn.parse().expect("a number")));
    assert_eq!(cells.len(), Baud::ALL.len() * (4 + 7));
    let step = if every { 1 } else { 3 };
    let failed: Vec<String> = cells
        .into_par_iter()
        .step_by(step)
        .flat_map_iter(|cell| failures(cell, every))
        .collect();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}
