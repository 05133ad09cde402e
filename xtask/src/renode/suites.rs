//! The suites of renode/tests, run by Renode's own renode-test.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Result, bail, ensure};
use fs_err as fs;
use register_map::Board;

use super::Bench;
use super::find::Places;
use crate::command;
use crate::group::Group;

/// Runs all suites. The results are in `robot` in the output directory, and as JUnit XML in `robot.xml`.
pub fn run(bench: &Bench, python: &Path) -> Result<()> {
    let tester = bench.renode.tester(&Places::of_process()?)?;
    let output = bench.output.join("robot");
    fs::create_dir_all(&output)?;
    let elf = bench.elf.to_string_lossy();
    ensure!(
        !elf.contains(['$', '%']),
        "{elf}: Robot Framework accepts no $ or % in a path; move the image"
    );
    let mut tester = Command::new(tester);
    tester.arg("-r").arg(&output);
    tester.args(["--variable", &format!("ELF:{elf}")]);
    tester.args(["--variable", &format!("BOARD_NAME:{}", bench.board)]);
    let status = Group::start({
        tester.args(all(&bench.directory, bench.board)?);
        tester
    })?
    .wait()?;
    // Convert the results even when tests failed, so that they can be shown.
    let failed = to_junit(
        python,
        &output.join("robot_output.xml"),
        &bench.output.join("robot.xml"),
    );
    match (status.code(), failed) {
        (Some(0), Ok(0)) => Ok(()),
        (Some(0), Ok(_)) => bail!("renode-test has hidden a failure"),
        (Some(1), Ok(failed)) => bail!(
            "{failed} tests failed, see {}",
            output.join("log.html").display()
        ),
        (Some(2), _) => bail!("Renode crashed, see {}", output.join("logs").display()),
        (Some(0 | 1), Err(error)) => Err(error),
        (Some(code), _) => {
            bail!(
                "renode-test ended with status {code}; it needs Python 3 with Renode's tests/requirements.txt"
            )
        }
        (None, _) => bail!("renode-test was ended ({status})"),
    }
}

/// Has Robot Framework convert its results to JUnit XML, and returns how many tests have failed. Results without a test
/// are an error.
fn to_junit(python: &Path, from: &Path, to: &Path) -> Result<i32> {
    ensure!(from.is_file(), "renode-test has left no {}", from.display());
    let mut rebot = Command::new(python);
    rebot.args(["-B", "-m", "robot.rebot"]);
    rebot.args([
        "--output", "NONE", "--log", "NONE", "--report", "NONE", "--xunit",
    ]);
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
    let mut suites: Vec<PathBuf> = of_any
        .chain(of_board)
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "robot")
        })
        .collect();
    suites.sort();
    ensure!(!suites.is_empty(), "no suites in {}", tests.display());
    Ok(suites)
}
