//! What can be checked of Renode's files without Renode: the Python models do what the firmware needs,
//! the image starts on them, every suite names keywords that Renode has and calls them right, and, played on the project's own
//! simulator, the suites expect of the unit what it does.
//!
//! The platform and the scripts are checked by tests of this package (`platform`).

use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;

use register_map::{Board, Module, configuration, record};
use serde_json::{Value, json};

use super::DIRECTORY;
use crate::python::Environment;
use crate::steps::Outcome;
use crate::workspace::Workspace;
use crate::{Failure, Result, command, sim};

/// The step of `cargo xtask test` for a board: the models, the image on them, and a dry run of the suites. Skipped with
/// the reason where there is no Python or nothing from PyPI, but failed when `strict`, as in CI.
pub fn step(workspace: &Workspace, board: &Board, elf: &Path, strict: bool) -> Outcome {
    with_robot(workspace, strict, |python, checks, output| {
        models(python, checks, board, elf)?;
        robot(python, checks, board, output, &["--dryrun"])
    })
}

/// The step of `cargo xtask ci`: the suites against the image in the simulator, which takes minutes.
pub fn on_simulator(workspace: &Workspace, board: &Board, elf: &Path, strict: bool) -> Outcome {
    with_robot(workspace, strict, |python, checks, output| {
        let simulator = sim::simulator(workspace)?;
        let options = [
            "--exclude",
            "renode-only",
            "--exclude",
            "exact-time",
            "--variable",
            &format!("SIMULATOR:{}", simulator.display()),
            "--variable",
            &format!("ELF:{}", elf.display()),
        ];
        robot(python, checks, board, output, &options)
    })
}

fn with_robot(
    workspace: &Workspace,
    strict: bool,
    check: impl FnOnce(&Path, &Path, &Path) -> Result<()>,
) -> Outcome {
    let checks = workspace.root().join(DIRECTORY).join("checks");
    let environment = Environment {
        what: "Robot Framework with Unicorn",
        directory: &workspace.target().join("renode-venv"),
        requirements: &[checks.join("requirements.txt")],
        imports: "robot, unicorn",
        oldest: 8,
    };
    match environment.prepare() {
        Ok(python) => check(&python, &checks, &workspace.target().join("renode-checks")).into(),
        Err(missing) => Outcome::missing(&missing, strict),
    }
}

/// Runs the unit tests of the models, of the monitor's commands and of the stand-ins for Renode, and starts
/// the image on the models.
fn models(python: &Path, checks: &Path, board: &Board, elf: &Path) -> Result<()> {
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
        // Leaves no __pycache__ in the tree.
        python.arg("-B").arg(checks.join(test)).args(arguments);
        command::run(&mut python)?;
    }
    Ok(())
}

/// What the register map has a new device store, in JSON: board, modules by port, address and bytes; for every module in
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
            // A setting for each slot fits.
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

/// Runs Robot Framework on the suites as renode-test does, with our keywords in place of Renode's.
fn robot(
    python: &Path,
    checks: &Path,
    board: &Board,
    output: &Path,
    options: &[&str],
) -> Result<()> {
    let mut robot = Command::new(python);
    robot.args([
        "-B",
        "-m",
        "robot",
        "--console",
        "quiet",
        "--prerunmodifier",
    ]);
    robot.arg(checks.join("AsRenodeTest.py"));
    robot.arg("--outputdir").arg(output).args(options);
    robot.arg("--variable").arg(format!("BOARD_NAME:{board}"));
    robot.args(super::suites::all(
        checks.parent().unwrap_or(checks),
        board,
    )?);
    command::run(&mut robot).map_err(|failure| {
        let log = output.join("log.html");
        Failure::new(format!("{failure}, see {}", log.display()))
    })
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
