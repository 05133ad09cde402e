//! Checks of Renode's files without Renode: the Python files have only what Renode's Python has, every name in scripts
//! and suites is that of a file, a command or a device, and every suite calls keywords that Renode has with the right
//! arguments. Whether the image serves there only Renode itself can say.
//!
//! Tests of this package (`platform`) check the platform and the scripts against the boards.

use std::path::PathBuf;

use anyhow::{Context as _, Result};

use super::DIRECTORY;
use crate::workspace::Workspace;
use crate::{command, python};

/// The tests, relative to the root.
const CHECKS: &str = "renode/checks";

/// Checks the Python files and the names, and the suites of all boards in a dry run.
pub fn files(workspace: &mut Workspace) -> Result<()> {
    let python = python(workspace)?;
    let mut tests = python::python(&python);
    tests.args(["-m", "unittest", "discover", "--start-directory"]);
    tests.arg(workspace.root.join(CHECKS));
    command::run(&mut tests)?;
    let output = workspace.target.join("renode-checks");
    let mut robot = python::python(&python);
    robot.args("-m robot --dryrun --console quiet --prerunmodifier".split(' '));
    robot.arg(workspace.root.join(CHECKS).join("AsRenodeTest.py"));
    robot.arg("--outputdir").arg(&output);
    robot.arg(workspace.root.join(DIRECTORY).join("tests"));
    command::run(&mut robot).with_context(|| format!("see {}", output.join("log.html").display()))
}

/// Returns the interpreter of an environment with Robot Framework.
pub fn python(workspace: &Workspace) -> Result<PathBuf> {
    let requirements = format!("{CHECKS}/requirements.txt");
    python::environment(workspace, "renode", &[&requirements])
}
