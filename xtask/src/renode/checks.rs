//! Checks of Renode's files without Renode: the Python models work as the firmware needs, the image starts on them,
//! every suite calls keywords that Renode has with the right arguments, and the suites pass on the project's own
//! simulator.
//!
//! Tests of this package (`platform`) check the platform and the scripts.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use register_map::{Board, Module, configuration, record};
use serde_json::{Value, json};

use super::{DIRECTORY, suites::all};
use crate::workspace::Workspace;
use crate::{build, command, python};

/// The tests, relative to the root.
const CHECKS: &str = "renode/checks";

/// Checks the models, the image on them, and in a dry run the suites.
pub fn files(workspace: &mut Workspace, board: &'static Board) -> Result<()> {
    let elf = build::image(workspace, board)?;
    let python = python(workspace)?;
    let mut tests = python::python(&python);
    tests.args(["-m", "unittest", "discover", "--start-directory"]);
    tests.arg(workspace.root.join(CHECKS));
    tests.env("MODIO_BOARD", board.name).env("MODIO_ELF", elf);
    command::run(tests.env("MODIO_PRESETS", presets()))?;
    robot(workspace, &python, board, &["--dryrun"])
}

/// Runs the suites against the image in the simulator, which takes minutes.
pub fn suites(workspace: &mut Workspace, board: &'static Board) -> Result<()> {
    let python = python(workspace)?;
    let elf = build::image(workspace, board)?;
    let elf = format!("--variable=ELF:{}", elf.display());
    let simulator = workspace.simulator()?;
    let simulator = format!("--variable=SIMULATOR:{}", simulator.display());
    let options = ["--exclude=renode-only", &simulator, &elf];
    robot(workspace, &python, board, &options)
}

/// Returns the interpreter of an environment with Robot Framework and Unicorn.
pub fn python(workspace: &Workspace) -> Result<PathBuf> {
    let requirements = format!("{CHECKS}/requirements.txt");
    python::environment(workspace, "renode", &[&requirements])
}

/// Returns what a new device stores, as JSON rows of board, modules by port, address and bytes: for every module in
/// every slot alone, and for different modules in all slots.
fn presets() -> String {
    let mut presets = Vec::new();
    for board in Board::ALL {
        let mut add = |modules: &[(u16, Module)]| {
            let names = modules.iter().map(|(port, name)| format!("{port}={name}"));
            let names = names.collect::<Vec<_>>().join(",");
            let mut page = [0xFF; 256];
            let pairs: Vec<_> = configuration::modules(modules.iter().copied()).collect();
            // A setting for each slot must fit.
            let length = record::encode_page(0, &pairs, &mut page).unwrap_or_default();
            let page = &page[..length];
            presets.push(json!([board.name, names, board.store.first, page]));
        };
        for module in Module::ALL {
            board.ports().for_each(|port| add(&[(port, module)]));
        }
        let different = board.ports().zip(Module::ALL.into_iter().skip(1));
        add(&different.collect::<Vec<_>>());
    }
    Value::Array(presets).to_string()
}

/// Runs Robot Framework on the suites as renode-test does, with the project's keywords instead of Renode's.
fn robot(workspace: &Workspace, python: &Path, board: &Board, options: &[&str]) -> Result<()> {
    let output = workspace.target.join("renode-checks");
    let mut robot = python::python(python);
    robot.args("-m robot --console quiet --prerunmodifier".split(' '));
    robot.arg(workspace.root.join(CHECKS).join("AsRenodeTest.py"));
    robot.arg("--outputdir").arg(&output).args(options);
    robot.args(["--variable", &format!("BOARD_NAME:{board}")]);
    robot.args(all(&workspace.root.join(DIRECTORY), board)?);
    command::run(&mut robot).with_context(|| format!("see {}", output.join("log.html").display()))
}
