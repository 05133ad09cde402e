//! The suites of renode/tests, run by Renode's own renode-test.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use register_map::Board;

use super::find::Surroundings;
use super::processes::Group;
use super::{Bench, report};
use crate::{Failure, Result};

/// What a suite's variable must not hold where Robot Framework splits or expands it.
const SPECIAL: [char; 2] = ['$', '%'];

/// Runs all suites; their results go to `robot` in the output directory.
///
/// # Errors
///
/// When renode-test is missing or a test failed, with how many.
pub(super) fn run(bench: &Bench) -> Result<()> {
    let tester = bench.renode.tester(&Surroundings::of_process())?;
    let output = bench.output.join("robot");
    fs::create_dir_all(&output)
        .map_err(|error| Failure::new(format!("cannot make {}: {error}", output.display())))?;
    let elf = bench.elf.to_string_lossy();
    if elf.contains(SPECIAL) {
        let what = format!("{elf}: Robot Framework takes no $ or % in a path");
        return Err(Failure::new(what));
    }
    let mut command = Command::new(tester);
    command.arg("-r").arg(&output);
    command.arg("--variable").arg(format!("ELF:{elf}"));
    command
        .arg("--variable")
        .arg(format!("BOARD_NAME:{}", bench.board));
    command.args(all(&bench.directory, bench.board)?);
    let status = Group::start(&mut command)?.wait()?;
    // Also when tests failed: what is there is to be read by whatever shows results.
    let told = report::robot_to_junit(
        &output.join("robot_output.xml"),
        &bench.output.join("robot.xml"),
    );
    match (status.code(), told) {
        (Some(0), Ok(counts)) if counts.failed == 0 && counts.passed > 0 => Ok(()),
        (Some(0), Ok(_)) => Err(Failure::new("renode-test ran no test, or hid a failure")),
        (Some(0), Err(failure)) => Err(failure),
        (Some(1), Err(failure)) => Err(failure),
        (Some(1), Ok(counts)) => Err(Failure::new(format!(
            "{} of {} tests failed, see {}",
            counts.failed,
            counts.passed + counts.failed + counts.skipped,
            output.join("log.html").display()
        ))),
        (Some(2), _) => Err(Failure::new(format!(
            "Renode crashed, see {}",
            output.join("logs").display()
        ))),
        (Some(code), _) => Err(Failure::new(format!(
            "renode-test ended with status {code}; it needs Python 3 with Renode's tests/requirements.txt"
        ))),
        (None, _) => Err(Failure::new(format!("renode-test was ended ({status})"))),
    }
}

/// The suites for a board, in the order of their names: those in tests are about any board, those in a directory of a
/// board's name there about that board.
///
/// # Errors
///
/// When there are none.
pub(super) fn all(directory: &Path, board: &Board) -> Result<Vec<PathBuf>> {
    let tests = directory.join("tests");
    let of_any = fs::read_dir(&tests)
        .map_err(|error| Failure::new(format!("{}: {error}", tests.display())))?;
    // A board need not have suites that are about it alone.
    let of_board = fs::read_dir(tests.join(board.name)).into_iter().flatten();
    let mut suites: Vec<PathBuf> = of_any
        .chain(of_board)
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "robot")
        })
        .collect();
    suites.sort();
    if suites.is_empty() {
        return Err(Failure::new(format!("no suites in {}", tests.display())));
    }
    Ok(suites)
}
