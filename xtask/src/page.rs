//! The simulator's page in Chromium: its tests, and `cargo xtask screenshots`. Chromium must be installed. Playwright,
//! which controls it, is in a virtual environment under target/.

use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};
use register_map::board::{MODIO_02, MODIO_08};

use crate::error::Missing;
use crate::python::Environment;
use crate::workspace::Workspace;
use crate::{build, command, pymodbus};

/// The tests, the script for the pictures, and their requirements.
const SCRIPTS: &str = "tools/sim/tests/page";

/// The pictures for the documentation.
const IMAGES: &str = "docs/images";

/// Runs the tests of the page.
pub fn check(workspace: &Workspace, elf: &Path, elf_08: &Path) -> Result<()> {
    let python = tools(workspace)?;
    let run = pymodbus::runner(workspace);
    let mut script = pymodbus::script(workspace, &python, &run, elf, elf_08)?;
    command::run(script.arg("--tests").arg(workspace.root().join(SCRIPTS)))
}

/// `cargo xtask screenshots`.
pub fn screenshots(workspace: &mut Workspace) -> Result<()> {
    let python = tools(workspace)?;
    let elf = build::image(workspace, &MODIO_02)?.elf;
    let elf_08 = build::image(workspace, &MODIO_08)?.elf;
    let script = workspace.root().join(SCRIPTS).join("screenshots.py");
    let mut script = pymodbus::script(workspace, &python, &script, &elf, &elf_08)?;
    command::run(script.arg("--to").arg(workspace.root().join(IMAGES)))
}

/// Returns the interpreter of the environment. The error is [`Missing`] when there is no browser.
fn tools(workspace: &Workspace) -> Result<PathBuf> {
    let missing = "no browser for the simulator's page (on Debian: apt-get install chromium)";
    ensure!(
        which::which("chromium").is_ok(),
        Missing(missing.to_owned())
    );
    Environment {
        what: "Playwright with pymodbus",
        directory: &workspace.target().join("page-venv"),
        requirements: &[
            workspace.root().join(SCRIPTS).join("requirements.txt"),
            pymodbus::requirements(workspace),
        ],
        imports: "playwright, axe_playwright_python, PIL, pymodbus, serial",
        oldest: 10,
    }
    .prepare()
}
