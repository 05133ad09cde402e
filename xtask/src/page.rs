//! The simulator's page in Chromium: its tests, a step of `cargo xtask test`, and `cargo xtask screenshots`. The browser
//! is the machine's own; what drives it stands in a virtual environment under target/.

use std::path::{Path, PathBuf};
use std::process::Command;

use register_map::board::{MODIO_02, MODIO_08};

use crate::python::Environment;
use crate::steps::Outcome;
use crate::workspace::Workspace;
use crate::{Failure, Result, build, command, pymodbus, sim};

/// The tests, the script for the pictures, and their requirements.
const SCRIPTS: &str = "tools/sim/tests/page";
/// The pictures in the documents.
const IMAGES: &str = "docs/images";
/// The browser.
const CHROMIUM: &str = "chromium";

/// The images of both boards.
#[derive(Clone, Copy, Debug)]
pub struct Images<'a> {
    /// That of the modio-02.
    pub modio_02: &'a Path,
    /// That of the modio-08.
    pub modio_08: &'a Path,
}

/// The step: skipped with the reason where Chromium or Python is missing, but failed when `strict`, as in CI.
pub fn step(workspace: &Workspace, images: Images<'_>, strict: bool) -> Outcome {
    match tools(workspace, CHROMIUM) {
        Ok(python) => {
            let tests = workspace.root().join(SCRIPTS);
            let run = pymodbus::runner(workspace);
            drive(
                workspace,
                &python,
                &run,
                images,
                &["--tests".as_ref(), &tests],
            )
            .into()
        }
        Err(missing) => Outcome::missing(&missing, strict),
    }
}

/// `cargo xtask screenshots`.
///
/// # Errors
///
/// When Chromium or Python is missing, an image or the simulator does not build, or the pictures cannot be taken.
pub fn screenshots(workspace: &mut Workspace) -> Result<()> {
    let python = tools(workspace, CHROMIUM)?;
    let modio_02 = build::image(workspace, &MODIO_02)?.elf;
    let modio_08 = build::image(workspace, &MODIO_08)?.elf;
    let images = Images {
        modio_02: &modio_02,
        modio_08: &modio_08,
    };
    let script = workspace.root().join(SCRIPTS).join("screenshots.py");
    let to = workspace.root().join(IMAGES);
    drive(workspace, &python, &script, images, &["--to".as_ref(), &to])
}

/// Returns the interpreter of the environment, once it is known that there is a browser to drive.
fn tools(workspace: &Workspace, chromium: &str) -> Result<PathBuf> {
    command::read(Command::new(chromium).arg("--version")).map_err(|why| {
        Failure::new(format!(
            "no browser for the simulator's page (on Debian: apt-get install {CHROMIUM}): {why}"
        ))
    })?;
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

/// Runs a script on the simulator with both images.
fn drive(
    workspace: &Workspace,
    python: &Path,
    script: &Path,
    images: Images<'_>,
    more: &[&Path],
) -> Result<()> {
    let simulator = sim::simulator(workspace)?;
    let mut script = pymodbus::script(workspace, python, script, &simulator, images.modio_02);
    script.arg("--elf-08").arg(images.modio_08).args(more);
    command::run(&mut script)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_browser_is_reported_with_its_package() {
        let workspace = Workspace::open().unwrap();
        let text = tools(&workspace, "no-browser-here")
            .unwrap_err()
            .to_string();
        assert!(text.contains("apt-get install chromium"), "{text}");
        assert!(text.contains("no-browser-here is not installed"), "{text}");
    }
}
