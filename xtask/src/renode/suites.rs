//! The suites of renode/tests, run by Renode's own renode-test.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use anyhow::{Result, bail, ensure};
use fs_err as fs;
use register_map::Row;

use super::Setup;
use crate::group::Group;
use crate::{command, python};

/// Runs all suites. The results are in `robot` in the output directory, and as JUnit XML in `robot.xml`.
pub fn run(setup: &Setup, python: &Path) -> Result<()> {
    let output = setup.output.join("robot");
    fs::create_dir_all(&output)?;
    let mut tester = Command::new(setup.renode.tester()?);
    tester.arg("-r").arg(&output);
    tester.args(["--variable", &format!("ELF:{}", setup.elf.display())]);
    let image = match &setup.image {
        Some(image) => format!("IMAGE:{}", image.display()),
        None => "PLAIN:true".to_owned(),
    };
    tester.args(["--variable", &image]);
    tester.args(["--variable", &format!("BOARD_NAME:{}", setup.board)]);
    tester.args(all(&setup.directory, setup.board)?);
    let status = Group::start(tester)?.wait(Duration::MAX)?;
    // Convert the results even when tests failed, so that they can be shown.
    let converted = to_junit(python, &output, &setup.output.join("robot.xml"));
    let output = output.display();
    match status.and_then(|status| status.code()) {
        Some(0) => converted,
        Some(1) => bail!("tests failed, see {output}/log.html"),
        Some(2) => bail!("Renode crashed, see {output}/logs"),
        status => bail!(
            "renode-test ended with status {status:?}; it needs Python 3 with Renode's tests/requirements.txt"
        ),
    }
}

/// Has Robot Framework convert its results in a directory to JUnit XML. Results without a test are an error.
fn to_junit(python: &Path, results: &Path, to: &Path) -> Result<()> {
    let mut rebot = python::python(python);
    rebot.args("-m robot.rebot --output NONE --log NONE --report NONE --xunit".split(' '));
    let output = command::output(rebot.arg(to).arg(results.join("robot_output.xml")))?;
    // The exit status of rebot is the number of failed tests, or above 250 an error.
    let converted = matches!(output.status.code(), Some(0..=250));
    ensure!(
        converted,
        "no results of the suites: {}",
        command::complaint(&output)
    );
    Ok(())
}

/// Returns the suites for a board, in the order of their names: those in tests, which are for any board, and those in
/// the directory there with the name of the board.
fn all(directory: &Path, board: &Row) -> Result<Vec<PathBuf>> {
    let tests = directory.join("tests");
    // A board need not have separate suites.
    let of_board = fs::read_dir(tests.join(board.name)).into_iter().flatten();
    let mut suites = Vec::new();
    for file in fs::read_dir(&tests)?.chain(of_board) {
        let file = file?.path();
        if file
            .extension()
            .is_some_and(|extension| extension == "robot")
        {
            suites.push(file);
        }
    }
    suites.sort();
    Ok(suites)
}
