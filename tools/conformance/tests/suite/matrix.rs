//! Tests the image at every rate and format of the register map, in RTU and in ASCII mode.
//!
//! Every test run includes the cases that depend on rate or format. `cargo xtask matrix` sets `MODIO_MATRIX` and runs
//! every case.

use std::env;

use conformance::case::Case;
use conformance::cases::all;
use conformance::endpoint::sim::Fitting;
use conformance::frame::Mode;
use conformance::line::LineFormat;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};
use register_map::Module;
use register_map::codes::{self, Baud, Format};

use super::{failed, in_process, line, modio_02, passed};

/// Set to run every case.
const VARIABLE: &str = "MODIO_MATRIX";

/// Parts of the names of cases that depend on rate or format.
const CHOSEN: [&str; 7] = [
    "timing/",
    "gaps/",
    "damage/",
    "ascii/",
    "fc03/quantity-most",
    "bus/own-echo",
    "framing/no-byte",
];

/// Parts of the names of the cases that take longest: they damage each character of a frame in turn, or wait for a
/// second each time.
const LONG: [&str; 3] = ["ascii/truncated", "ascii/damaged", "ascii/gap"];

/// A rate, a format and a mode that can be used together.
type Cell = (LineFormat, Mode);

fn cells() -> Vec<Cell> {
    let mut cells = Vec::new();
    for baud in Baud::ALL {
        for (format, (_, name)) in Format::ALL.iter().zip(Format::NAMES) {
            let line = line(baud.bits_per_second(), name);
            for (mode, of_map) in [
                (Mode::Rtu, codes::Mode::Rtu),
                (Mode::Ascii, codes::Mode::Ascii),
            ] {
                if format.suits(of_map) {
                    cells.push((line, mode));
                }
            }
        }
    }
    cells
}

/// The cases to run. The tours of all rates and formats run only at one rate and format.
fn cases(every: bool, (line, _): Cell) -> Vec<Case> {
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
    let (line, mode) = cell;
    let fitting = Fitting {
        line,
        mode,
        ..modio_02(Module::Do4)
    };
    let outcomes = in_process(&fitting, &cases(every, cell));
    let passed = passed(&outcomes);
    println!("{line} {mode:?}: {passed} passed");
    let least = if every { 150 } else { 12 };
    assert!(passed > least, "{cell:?}: only {passed} cases passed");
    let rows = failed(&outcomes).into_iter();
    rows.map(|row| format!("{line} {mode:?}: {row}")).collect()
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_rate_and_format_conforms() {
    let every = env::var_os(VARIABLE).is_some();
    let cells = cells();
    assert_eq!(cells.len(), Baud::ALL.len() * (4 + 7));
    let failed: Vec<String> = cells
        .into_par_iter()
        .flat_map_iter(|cell| failures(cell, every))
        .collect();
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}
