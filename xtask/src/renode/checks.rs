//! What can be checked of Renode's files without Renode: the Python models do what the firmware needs,
//! the image starts on them, every suite names keywords that Renode has and calls them right, and, played on the project's own
//! simulator, the suites expect of the unit what it does.
//!
//! The platform and the scripts are checked by tests of this package (`platform`).

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use register_map::{Board, Module, configuration, record};
use serde_json::{Value, json};

use super::DIRECTORY;
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
    let environment = workspace.target().join("renode-venv");
    match prepare("python3", &environment, &checks.join("requirements.txt")) {
        Ok(python) => check(&python, &checks, &workspace.target().join("renode-checks")).into(),
        Err(missing) if strict => Outcome::Failed(missing.to_string()),
        Err(missing) => Outcome::Skipped(missing.to_string()),
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

/// Makes the virtual environment, or takes the one made earlier from the same requirements, and tells
/// its interpreter.
fn prepare(python: &str, environment: &Path, requirements: &Path) -> Result<PathBuf> {
    let wanted = fs::read_to_string(requirements)
        .map_err(|error| Failure::new(format!("{}: {error}", requirements.display())))?;
    let interpreter = environment.join(if cfg!(windows) {
        "Scripts/python.exe"
    } else {
        "bin/python"
    });
    // Written last, so that an installation cut short is not taken for a whole one.
    let stamp = environment.join("installed.txt");
    let works = || command::read(Command::new(&interpreter).args(["-c", "import robot, unicorn"]));
    if fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) && works().is_ok() {
        return Ok(interpreter);
    }
    command::read(
        Command::new(python).args(["-c", "import sys; sys.exit(sys.version_info < (3, 8))"]),
    )
    .map_err(|_| {
        Failure::new("Robot Framework needs Python 3.8 or newer as python3 on the PATH")
    })?;
    eprintln!("making {}", environment.display());
    let mut venv = Command::new(python);
    venv.args(["-m", "venv", "--clear"]).arg(environment);
    command::read(&mut venv).map_err(|why| {
        Failure::new(format!(
            "no virtual environment (on Debian: python3-venv): {why}"
        ))
    })?;
    let mut pip = Command::new(&interpreter);
    pip.args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
    ]);
    pip.arg("--requirement").arg(requirements);
    command::read(&mut pip).map_err(|why| {
        Failure::new(format!(
            "Robot Framework and Unicorn cannot be installed from PyPI: {why}"
        ))
    })?;
    fs::write(&stamp, wanted)
        .map_err(|error| Failure::new(format!("cannot write {}: {error}", stamp.display())))?;
    Ok(interpreter)
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

    #[test]
    fn without_python_the_step_says_so() {
        let directory = tempfile::tempdir().unwrap();
        let requirements = directory.path().join("requirements.txt");
        fs::write(&requirements, "robotframework==6.1\n").unwrap();
        let environment = directory.path().join("venv");
        let failure = prepare("no-python-here", &environment, &requirements).unwrap_err();
        assert!(failure.to_string().contains("Python 3.8"), "{failure}");
    }
}
