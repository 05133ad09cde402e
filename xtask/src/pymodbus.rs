//! pymodbus and mbpoll, Modbus masters that nobody here wrote, against the image in simulation: a virtual
//! environment for the first under target/, and the script that drives them. mbpoll is the machine's own. The script
//! runs the tests of the simulator's Python client as well.
//! `cargo xtask peers` uses the environment as well.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::python::Environment;
use crate::steps::Outcome;
use crate::workspace::Workspace;
use crate::{Failure, Result, command, sim};

/// The script and its requirements, which pin the versions.
const SCRIPTS: &str = "tools/sim/tests/pymodbus";

/// The second master, on libmodbus.
const MBPOLL: &str = "mbpoll";

/// The step: skipped with the reason where one of the masters cannot be had, but failed when `strict`, as
/// in CI. Without mbpoll the script leaves its tests out, and the others have to pass all the same.
/// `elf_08` is the image of the modio-08, if there is one, for the tests of the client.
pub fn step(workspace: &Workspace, elf: &Path, elf_08: Option<&Path>, strict: bool) -> Outcome {
    match environment(workspace) {
        Ok(python) => match drive(workspace, &python, elf, elf_08) {
            Ok(()) => find(MBPOLL).map_or_else(
                |missing| Outcome::missing(&missing, strict),
                |()| Outcome::Passed,
            ),
            Err(failure) => Outcome::Failed(failure.to_string()),
        },
        Err(missing) => Outcome::missing(&missing, strict),
    }
}

/// Makes the virtual environment with pymodbus, or takes the one made earlier; returns its interpreter.
///
/// # Errors
///
/// When Python or its module venv is missing, or PyPI cannot be reached, with what to install.
pub fn environment(workspace: &Workspace) -> Result<PathBuf> {
    Environment {
        what: "pymodbus",
        directory: &workspace.target().join("pymodbus-venv"),
        requirements: &[requirements(workspace)],
        imports: "pymodbus, serial",
        oldest: 10,
    }
    .prepare()
}

/// The file that pins pymodbus and the serial port below it.
pub fn requirements(workspace: &Workspace) -> PathBuf {
    workspace.root().join(SCRIPTS).join("requirements.txt")
}

/// Whether mbpoll is there.
fn find(mbpoll: &str) -> Result<()> {
    match command::read(Command::new(mbpoll).arg("-V")) {
        Ok(_) => Ok(()),
        Err(why) => Err(Failure::new(format!(
            "all is well with pymodbus, but mbpoll was not tried (on Debian: apt-get install mbpoll): {why}"
        ))),
    }
}

/// The script that runs the tests of a directory.
pub fn runner(workspace: &Workspace) -> PathBuf {
    workspace.root().join(SCRIPTS).join("run.py")
}

/// The call of a script that tests an image in the simulator.
pub fn script(
    workspace: &Workspace,
    python: &Path,
    script: &Path,
    simulator: &Path,
    elf: &Path,
) -> Command {
    let mut command = Command::new(python);
    // -B: leaves no __pycache__ in the tree.
    command.arg("-B").arg(script);
    command.arg("--sim").arg(simulator).arg("--elf").arg(elf);
    command.current_dir(workspace.root());
    command
}

fn drive(workspace: &Workspace, python: &Path, elf: &Path, elf_08: Option<&Path>) -> Result<()> {
    let simulator = sim::simulator(workspace)?;
    let run = runner(workspace);
    let mut script = script(workspace, python, &run, &simulator, elf);
    if let Some(elf) = elf_08 {
        script.arg("--elf-08").arg(elf);
    }
    command::run(&mut script)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use crate::script::program;

    #[test]
    fn without_mbpoll_the_step_is_skipped_with_the_package_to_install_but_failed_in_ci() {
        let missing = find("no-mbpoll-here").unwrap_err();
        assert!(missing.to_string().contains("apt-get install mbpoll"));
        let skipped = Outcome::Skipped(missing.to_string());
        assert_eq!(Outcome::missing(&missing, false), skipped);
        let failed = Outcome::Failed(missing.to_string());
        assert_eq!(Outcome::missing(&missing, true), failed);
        let directory = tempfile::tempdir().unwrap();
        let there = program(directory.path(), MBPOLL, "[ \"$1\" = -V ]");
        assert_eq!(find(&there.to_string_lossy()), Ok(()));
    }
}
