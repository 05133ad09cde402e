//! The suites of renode/tests, run by Renode's own renode-test.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use anyhow::{Result, bail, ensure};
use fs_err as fs;
use register_map::Board;

use super::Bench;
use crate::command;
use crate::group::Group;

/// Runs all suites. The results are in `robot` in the output directory, and as JUnit XML in `robot.xml`.
pub fn run(bench: &Bench, python: &Path) -> Result<()> {
    let output = bench.output.join("robot");
    fs::create_dir_all(&output)?;
    let elf = bench.elf.to_string_lossy();
    ensure!(
        !elf.contains(['$', '%']),
        "{elf}: Robot Framework accepts no $ or % in a path; move the image"
    );
    let mut tester = Command::new(bench.renode.tester()?);
    tester.arg("-r").arg(&output);
    tester.args(["--variable", &format!("ELF:{elf}")]);
    tester.args(["--variable", &format!("BOARD_NAME:{}", bench.board)]);
    tester.args(all(&bench.directory, bench.board)?);
    let status = Group::start(tester)?.wait(Duration::MAX)?;
    let status = status.and_then(|status| status.code());
    // Convert the results even when tests failed, so that they can be shown.
    let failed = to_junit(
        python,
        &output.join("robot_output.xml"),
        &bench.output.join("robot.xml"),
    );
    let (log, logs) = (output.join("log.html"), output.join("logs"));
    match status {
        Some(0 | 1) => {}
        Some(2) => bail!("Renode crashed, see {}", logs.display()),
        _ => bail!(
            "renode-test ended with status {status:?}; it needs Python 3 with Renode's tests/requirements.txt"
        ),
    }
    let failed = failed?;
    ensure!(
        failed == 0 && status == Some(0),
        "{failed} tests failed, see {}",
        log.display()
    );
    Ok(())
}

/// Has Robot Framework convert its results to JUnit XML, and returns how many tests have failed. Results without a test
/// are an error.
fn to_junit(python: &Path, from: &Path, to: &Path) -> Result<i32> {
    ensure!(from.is_file(), "renode-test has left no {}", from.display());
    let mut rebot = Command::new(python);
    rebot.args([
        "-B",
        "-m",
        "robot.rebot",
        "--output",
        "NONE",
        "--log",
        "NONE",
    ]);
    rebot.args(["--report", "NONE", "--xunit"]);
    let output = command::output(rebot.arg(to).arg(from))?;
    // The exit status of rebot is the number of failed tests, or above 250 an error.
    match output.status.code() {
        Some(failed @ 0..=250) => Ok(failed),
        _ => bail!("{}: {}", from.display(), command::complaint(&output)),
    }
}

/// Returns the suites for a board, in the order of their names: those in tests, which are for any board, and those in
/// the directory there with the name of the board.
pub fn all(directory: &Path, board: &Board) -> Result<Vec<PathBuf>> {
    let tests = directory.join("tests");
    let of_any = fs::read_dir(&tests)?;
    // A board need not have separate suites.
    let of_board = fs::read_dir(tests.join(board.name)).into_iter().flatten();
    let files = of_any
        .chain(of_board)
        .filter_map(|entry| Some(entry.ok()?.path()));
    let is_suite = |path: &PathBuf| {
        path.extension()
            .is_some_and(|extension| extension == "robot")
    };
    let mut suites: Vec<PathBuf> = files.filter(is_suite).collect();
    suites.sort();
    Ok(suites)
}
