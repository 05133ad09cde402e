//! pymodbus and mbpoll, Modbus masters of other authors, against the images in simulation. pymodbus is in a virtual
//! environment under target/, mbpoll must be installed. The script that runs them also runs the tests of the
//! simulator's Python client.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Result, ensure};

use crate::error::Missing;
use crate::python::Environment;
use crate::workspace::Workspace;
use crate::{command, sim};

/// The script and its requirements, which pin the versions.
const SCRIPTS: &str = "tools/sim/tests/pymodbus";

/// Runs the tests. Without mbpoll the script leaves out the tests with it, and the others must pass.
pub fn check(workspace: &Workspace, elf: &Path, elf_08: &Path) -> Result<()> {
    let python = environment(workspace)?;
    command::run(&mut script(
        workspace,
        &python,
        &runner(workspace),
        elf,
        elf_08,
    )?)?;
    let missing =
        "passed with pymodbus, but mbpoll was not run (on Debian: apt-get install mbpoll)";
    ensure!(which::which("mbpoll").is_ok(), Missing(missing.to_owned()));
    Ok(())
}

/// Prepares the virtual environment with pymodbus, and returns its interpreter.
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

/// Returns the file that pins pymodbus and its serial port.
pub fn requirements(workspace: &Workspace) -> PathBuf {
    workspace.root().join(SCRIPTS).join("requirements.txt")
}

/// Returns the script that runs the tests of a directory.
pub fn runner(workspace: &Workspace) -> PathBuf {
    workspace.root().join(SCRIPTS).join("run.py")
}

/// Returns the call of a script that tests the images in the simulator.
pub fn script(
    workspace: &Workspace,
    python: &Path,
    script: &Path,
    elf: &Path,
    elf_08: &Path,
) -> Result<Command> {
    let mut command = Command::new(python);
    // -B: do not write __pycache__ to the tree.
    command.arg("-B").arg(script);
    command.arg("--sim").arg(sim::simulator(workspace)?);
    command.arg("--elf").arg(elf).arg("--elf-08").arg(elf_08);
    command.current_dir(workspace.root());
    Ok(command)
}
