//! Tests that are written in Python: other Modbus masters and the simulator's Python client, the simulator's page, and
//! its pictures for the documents. Their packages are in virtual environments under target/.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, ensure};
use register_map::Row;
use register_map::board::{FX3U_14, FX3U_24, MODIO_02, MODIO_08};

use crate::error::missing;
use crate::workspace::Workspace;
use crate::{command, images, ordinary};

/// The file that pins pymodbus and its serial port.
pub const PYMODBUS: &str = "tools/sim/tests/pymodbus/requirements.txt";

/// The script that runs the tests of a directory.
const RUN: &str = "tools/sim/tests/pymodbus/run.py";

/// The tests of the simulator's page, and the script for its pictures. Chromium shows the page, and Playwright controls
/// Chromium.
const PAGE: &str = "tools/sim/tests/page";

/// The tests of the commands in the documents.
const CONSOLE: &str = "tools/sim/tests/console";

/// Returns the interpreter of the environment `target/NAME-venv`, in which the packages of these files are installed.
/// The error is [`Missing`](crate::error::Missing).
pub fn environment(workspace: &Workspace, name: &str, requirements: &[&str]) -> Result<PathBuf> {
    let made = made(workspace, name, requirements);
    made.map_err(|why| missing(format!("no Python packages for {name}: {why:#}")))
}

fn made(workspace: &Workspace, name: &str, requirements: &[&str]) -> Result<PathBuf> {
    let directory = workspace.target.join(format!("{name}-venv"));
    let program = if cfg!(windows) {
        "Scripts/python.exe"
    } else {
        "bin/python"
    };
    let interpreter = directory.join(program);
    let mut pip = Command::new(&interpreter);
    pip.args("-m pip install --quiet --disable-pip-version-check".split(' '));
    for file in requirements {
        pip.arg("--requirement").arg(workspace.root.join(file));
    }
    // pip needs no network when the packages are already installed. It fails when there is no environment yet, and
    // after an update of Python, which has other directories.
    if command::read(&mut pip).is_err() {
        eprintln!("making {}", directory.display());
        let mut venv = Command::new("python3");
        command::read(venv.args(["-m", "venv", "--clear"]).arg(directory))
            .context("no virtual environment (on Debian: apt-get install python3-venv)")?;
        command::read(&mut pip)?;
    }
    Ok(interpreter)
}

/// Returns a call of an interpreter that does not write `__pycache__` to the tree.
pub fn python(interpreter: &Path) -> Command {
    let mut python = Command::new(interpreter);
    python.arg("-B");
    python
}

/// Runs pymodbus and mbpoll as masters of the images. Without mbpoll the script leaves out the tests with it, and the
/// others must pass.
pub fn masters(workspace: &mut Workspace) -> Result<()> {
    let python = environment(workspace, "pymodbus", &[PYMODBUS])?;
    command::run(&mut script(
        workspace,
        &python,
        RUN,
        &[&MODIO_02, &MODIO_08],
    )?)?;
    ensure!(
        which::which("mbpoll").is_ok(),
        missing("passed with pymodbus, but mbpoll was not run (on Debian: apt-get install mbpoll)")
    );
    Ok(())
}

/// Runs the tests of the simulator's page.
pub fn page(workspace: &mut Workspace) -> Result<()> {
    let mut script = on_page(workspace, RUN)?;
    command::run(script.arg("--tests").arg(workspace.root.join(PAGE)))
}

/// Runs the blocks `console run` of README.md and docs/, with the programs that these commands build.
pub fn console(workspace: &mut Workspace) -> Result<()> {
    for program in ["curl", "mbpoll"] {
        ensure!(
            which::which(program).is_ok(),
            missing(format!(
                "no {program}, which the documents use (on Debian: apt-get install {program})"
            ))
        );
    }
    let python = environment(workspace, "pymodbus", &[PYMODBUS])?;
    let modioctl = workspace.program("modioctl")?;
    let boards = [&MODIO_02, &MODIO_08, &FX3U_14, &FX3U_24];
    let mut script = script(workspace, &python, RUN, &boards)?;
    script.env("MODIOCTL", modioctl);
    command::run(script.arg("--tests").arg(workspace.root.join(CONSOLE)))
}

/// `cargo xtask screenshots`.
pub fn screenshots(workspace: &mut Workspace) -> Result<()> {
    let mut script = on_page(workspace, &format!("{PAGE}/screenshots.py"))?;
    command::run(script.arg("--to").arg(workspace.root.join("docs/images")))
}

fn on_page(workspace: &mut Workspace, name: &str) -> Result<Command> {
    ensure!(
        which::which("chromium").is_ok(),
        missing("no browser for the simulator's page (on Debian: apt-get install chromium)")
    );
    let playwright = format!("{PAGE}/requirements.txt");
    let python = environment(workspace, "page", &[&playwright, PYMODBUS])?;
    script(workspace, &python, name, &[&MODIO_02, &MODIO_08, &FX3U_24])
}

/// Returns the call of a script that tests the loader and the images of these boards in the simulator, as an ordinary user.
fn script(
    workspace: &mut Workspace,
    interpreter: &Path,
    name: &str,
    boards: &[&'static Row],
) -> Result<Command> {
    let python = python(interpreter);
    let mut script = match ordinary::words()? {
        [] => python,
        [first, rest @ ..] => {
            let mut script = Command::new(first);
            script.args(rest).arg(python.get_program());
            script.args(python.get_args());
            script
        }
    };
    script.arg(workspace.root.join(name));
    script.envs(images::variables(workspace, boards)?);
    script.env("MODIO_SIM", workspace.simulator()?);
    script.current_dir(&workspace.root);
    Ok(script)
}
