//! Checks of Renode's files without Renode: the Python models work as the firmware needs, the image starts on them,
//! every suite calls keywords that Renode has with the right arguments, and the suites pass on the project's own
//! simulator.
//!
//! Tests of this package (`platform`) check the platform and the scripts.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result};
use register_map::{Board, Module, configuration, record};
use serde_json::{Value, json};

use super::DIRECTORY;
use crate::python::Environment;
use crate::workspace::Workspace;
use crate::{command, sim};

/// Checks the models, the image on them, and in a dry run the suites.
pub fn files(workspace: &Workspace, board: &Board, elf: &Path) -> Result<()> {
    let python = python(workspace)?;
    models(workspace, &python, board, elf)?;
    robot(workspace, &python, board, &["--dryrun"])
}

/// Runs the suites against the image in the simulator, which takes minutes.
pub fn on_simulator(workspace: &Workspace, board: &Board, elf: &Path) -> Result<()> {
    let python = python(workspace)?;
    let simulator = format!("SIMULATOR:{}", sim::simulator(workspace)?.display());
    let elf = format!("ELF:{}", elf.display());
    let excluded = ["--exclude", "renode-only", "--exclude", "exact-time"];
    let variables = ["--variable", &simulator, "--variable", &elf];
    robot(workspace, &python, board, &[excluded, variables].concat())
}

/// Returns the interpreter of an environment with Robot Framework and Unicorn.
pub fn python(workspace: &Workspace) -> Result<PathBuf> {
    Environment {
        what: "Robot Framework with Unicorn",
        directory: &workspace.target().join("renode-venv"),
        requirements: &[checks(workspace).join("requirements.txt")],
        imports: "robot, unicorn",
        oldest: 8,
    }
    .prepare()
}

fn checks(workspace: &Workspace) -> PathBuf {
    workspace.root().join(DIRECTORY).join("checks")
}

/// Runs the unit tests of the models, of the monitor's commands and of the replacements for Renode, and starts the
/// image on the models.
fn models(workspace: &Workspace, python: &Path, board: &Board, elf: &Path) -> Result<()> {
    let presets = presets();
    let tests: [(&str, &[&OsStr]); 6] = [
        ("test_syntax.py", &[]),
        ("test_models.py", &[]),
        ("test_commands.py", &[presets.as_ref()]),
        ("test_terminal_tester.py", &[]),
        ("test_exact_line.py", &[]),
        ("test_boot.py", &[board.name.as_ref(), elf.as_os_str()]),
    ];
    for (test, arguments) in tests {
        let mut python = Command::new(python);
        // -B: do not write __pycache__ to the tree.
        python.arg("-B").arg(checks(workspace).join(test));
        python.args(arguments);
        command::run(&mut python)?;
    }
    Ok(())
}

/// Returns what a new device stores, as JSON rows of board, modules by port, address and bytes: for every module in
/// every slot alone, and for different modules in all slots.
fn presets() -> String {
    let mut presets = Vec::new();
    for board in Board::ALL {
        let mut choices: Vec<Vec<(u16, Module)>> = Vec::new();
        for module in Module::ALL {
            choices.extend(board.ports().map(|port| vec![(port, module)]));
        }
        let others = Module::ALL.into_iter().skip(1);
        choices.push(board.ports().zip(others).collect());
        for modules in choices {
            let names: Vec<String> = modules
                .iter()
                .map(|(port, module)| format!("{port}={module}"))
                .collect();
            let mut page = [0xFF; 256];
            let pairs: Vec<_> = configuration::modules(modules).collect();
            // A setting for each slot must fit.
            let length = record::encode_page(0, &pairs, &mut page).unwrap_or_default();
            let hex: String = page[..length]
                .iter()
                .map(|byte| format!("{byte:02x}"))
                .collect();
            presets.push(json!([board.name, names.join(","), board.store.first, hex]));
        }
    }
    Value::Array(presets).to_string()
}

/// Runs Robot Framework on the suites as renode-test does, with the project's keywords instead of Renode's.
fn robot(workspace: &Workspace, python: &Path, board: &Board, options: &[&str]) -> Result<()> {
    let output = workspace.target().join("renode-checks");
    let mut robot = Command::new(python);
    robot.args([
        "-B",
        "-m",
        "robot",
        "--console",
        "quiet",
        "--prerunmodifier",
    ]);
    robot.arg(checks(workspace).join("AsRenodeTest.py"));
    robot.arg("--outputdir").arg(&output).args(options);
    robot.args(["--variable", &format!("BOARD_NAME:{board}")]);
    robot.args(super::suites::all(
        &workspace.root().join(DIRECTORY),
        board,
    )?);
    command::run(&mut robot).with_context(|| format!("see {}", output.join("log.html").display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_module_has_a_preset_in_every_slot() {
        let presets: Value = serde_json::from_str(&presets()).unwrap();
        let presets = presets.as_array().unwrap();
        assert_eq!(presets.len(), Module::ALL.len() * 5 + 2);
        let last = presets.last().unwrap();
        assert_eq!(
            (&last[0], &last[2]),
            (&"modio-08".into(), &0x0803_F000.into())
        );
        assert_eq!(last[1], "1=4di,2=4do,3=2relay,4=4ai");
        let stored = last[3].as_str().unwrap();
        assert!(stored.starts_with("6f6b6d6f0101000000000400"), "{stored}");
    }
}
