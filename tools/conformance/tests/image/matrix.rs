//! Every rate and format of the register map, in RTU and in ASCII mode.
//!
//! Every test run tries the cases that depend on rate or format. `cargo xtask matrix` sets `MODIO_MATRIX` and tries
//! every case.

use std::env;
use std::sync::Mutex;
use std::thread;

use conformance::case::Case;
use conformance::cases::all;
use conformance::endpoint::sim::{Fitting, start};
use conformance::frame::Mode;
use conformance::line::LineFormat;
use conformance::report::table;
use conformance::run::Verdict;
use register_map::Module;
use register_map::board::MODIO_02;
use register_map::codes::{self, Baud, Format};

use super::{elf, outcomes};

/// Set when every case is wanted.
const VARIABLE: &str = "MODIO_MATRIX";

/// Parts of the names of cases that depend on rate or format.
const CHOSEN: [&str; 7] = [
    "timing/",
    "gaps/",
    "damage/",
    "ascii/",
    "fc03/",
    "bus/own-echo",
    "framing/no-byte",
];

/// Those that take the longest: they go through a frame character by character, or wait for a second each time.
const LONG: [&str; 3] = ["ascii/truncated", "ascii/damaged", "ascii/gap"];

/// A rate, a format and a mode that can be used together.
type Cell = (LineFormat, Mode);

fn cells() -> Vec<Cell> {
    let mut cells = Vec::new();
    for baud in Baud::ALL {
        for (format, (_, name)) in Format::ALL.iter().zip(Format::NAMES) {
            let line = LineFormat::new(
                baud.bits_per_second(),
                name.parse().expect("a name of a format"),
            );
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

/// The cases to try; at one rate and format the tours of all rates and formats are enough.
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

/// The failures of a cell, and the number of cases that passed.
fn failures(cell: Cell, every: bool) -> (Vec<String>, usize) {
    let (line, mode) = cell;
    let mut endpoint = start(&Fitting {
        elf: elf(&MODIO_02),
        board: &MODIO_02,
        module: Module::Do4,
        slots: Vec::new(),
        dip: 1,
        line,
        mode,
        settings: Vec::new(),
    })
    .expect("the image can be read");
    let outcomes = outcomes(&mut endpoint, 1, mode, &cases(every, cell));
    let passed = outcomes.iter().filter(|o| o.verdict == Verdict::Passed);
    let failed = outcomes
        .iter()
        .filter(|outcome| matches!(outcome.verdict, Verdict::Failed(_)))
        .map(|outcome| format!("{line} {mode:?}: {}", table::row(outcome)))
        .collect();
    (failed, passed.count())
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_rate_and_format_conforms() {
    let every = env::var_os(VARIABLE).is_some();
    let cells = cells();
    assert_eq!(cells.len(), Baud::ALL.len() * (4 + 7));
    let left = Mutex::new(cells.into_iter());
    let failed = Mutex::new(Vec::new());
    let next = || left.lock().expect("no thread has panicked").next();
    let threads = thread::available_parallelism().map_or(1, usize::from);
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(cell) = next() {
                    let (failures, passed) = failures(cell, every);
                    println!("{} {:?}: {passed} passed", cell.0, cell.1);
                    let least = if every { 150 } else { 15 };
                    assert!(passed > least, "{cell:?}: only {passed} cases apply");
                    failed.lock().expect("no panic").extend(failures);
                }
            });
        }
    });
    let failed = failed.into_inner().expect("no thread has panicked");
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}
