//! pymodbus and mbpoll, Modbus masters that nobody here wrote, against the image in simulation: a virtual
//! environment for the first under target/, and the script that drives them. mbpoll is the machine's own.
//! `cargo xtask peers` uses the environment as well.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::steps::Outcome;
use crate::workspace::Workspace;
use crate::{Failure, Result, command, sim};

/// The script and its requirements, which pin the versions.
const SCRIPTS: &str = "tools/sim/tests/pymodbus";

/// The second master, on libmodbus.
const MBPOLL: &str = "mbpoll";

/// The step: skipped with the reason where one of the masters cannot be had, but failed when `strict`, as
/// in CI. Without mbpoll the script leaves its tests out, and the others have to pass all the same.
pub fn step(workspace: &Workspace, elf: &Path, strict: bool) -> Outcome {
    let scripts = workspace.root().join(SCRIPTS);
    match environment(workspace) {
        Ok(python) => match drive(workspace, &python, &scripts, elf) {
            Ok(()) => {
                find(MBPOLL).map_or_else(|missing| lacking(&missing, strict), |()| Outcome::Passed)
            }
            Err(failure) => Outcome::Failed(failure.to_string()),
        },
        Err(missing) => lacking(&missing, strict),
    }
}

/// Makes the virtual environment with pymodbus, or takes the one made earlier; returns its interpreter.
///
/// # Errors
///
/// When Python or its module venv is missing, or PyPI cannot be reached, with what to install.
pub fn environment(workspace: &Workspace) -> Result<PathBuf> {
    let environment = workspace.target().join("pymodbus-venv");
    let requirements = workspace.root().join(SCRIPTS).join("requirements.txt");
    prepare("python3", &environment, &requirements)
}

/// What becomes of the step where a master is missing.
fn lacking(missing: &Failure, strict: bool) -> Outcome {
    if strict {
        Outcome::Failed(missing.to_string())
    } else {
        Outcome::Skipped(missing.to_string())
    }
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

fn drive(workspace: &Workspace, python: &Path, scripts: &Path, elf: &Path) -> Result<()> {
    let simulator = sim::simulator(workspace)?;
    command::run(
        Command::new(python)
            // Leaves no __pycache__ in the tree.
            .arg("-B")
            .arg(scripts.join("run.py"))
            .arg("--sim")
            .arg(simulator)
            .arg("--elf")
            .arg(elf)
            .current_dir(workspace.root()),
    )
}

/// Makes the virtual environment, or takes the one made earlier from the same requirements, and tells
/// its interpreter.
fn prepare(python: &str, environment: &Path, requirements: &Path) -> Result<PathBuf> {
    let wanted = fs::read_to_string(requirements).map_err(|error| {
        Failure::new(format!("cannot read {}: {error}", requirements.display()))
    })?;
    let interpreter = environment.join(if cfg!(windows) {
        "Scripts/python.exe"
    } else {
        "bin/python"
    });
    // Written last, so that an installation cut short is not taken for a whole one.
    let stamp = environment.join("installed.txt");
    let works =
        || command::read(Command::new(&interpreter).args(["-c", "import pymodbus, serial"]));
    if fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) && works().is_ok() {
        return Ok(interpreter);
    }
    let version = "import sys; sys.exit(sys.version_info < (3, 10))";
    command::read(Command::new(python).args(["-c", version]))
        .map_err(|_| Failure::new("pymodbus needs Python 3.10 or newer as python3 on the PATH"))?;
    eprintln!("making {}", environment.display());
    command::read(
        Command::new(python)
            .args(["-m", "venv", "--clear"])
            .arg(environment),
    )
    .map_err(|why| {
        Failure::new(format!(
            "no virtual environment (on Debian: python3-venv): {why}"
        ))
    })?;
    command::read(
        Command::new(&interpreter)
            .args([
                "-m",
                "pip",
                "install",
                "--quiet",
                "--disable-pip-version-check",
            ])
            .arg("--requirement")
            .arg(requirements),
    )
    .map_err(|why| Failure::new(format!("pymodbus cannot be installed from PyPI: {why}")))?;
    fs::write(&stamp, wanted)
        .map_err(|error| Failure::new(format!("cannot write {}: {error}", stamp.display())))?;
    Ok(interpreter)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use crate::script::program;

    /// A python3 whose `-m venv` makes an interpreter that writes down how it is called.
    const MAKES_VENV: &str = r#"
        [ "$2" = venv ] || exit 0
        mkdir -p "$4/bin"
        printf '#!/bin/sh\necho "$@" >> "%s/calls"\n' "$4" > "$4/bin/python"
        chmod +x "$4/bin/python""#;

    struct Case {
        directory: tempfile::TempDir,
        python: PathBuf,
    }

    impl Case {
        fn new(script: &str) -> Self {
            let directory = tempfile::tempdir().unwrap();
            let python = program(directory.path(), "python3", script);
            fs::write(directory.path().join("requirements.txt"), "pymodbus==3.0\n").unwrap();
            Self { directory, python }
        }

        fn prepare(&self) -> Result<PathBuf> {
            let at = |name| self.directory.path().join(name);
            prepare(
                &self.python.to_string_lossy(),
                &at("venv"),
                &at("requirements.txt"),
            )
        }

        fn installations(&self) -> usize {
            let calls = fs::read_to_string(self.directory.path().join("venv/calls"));
            calls.unwrap_or_default().matches("pip install").count()
        }
    }

    #[test]
    fn the_environment_is_made_once_and_again_for_other_versions() {
        let case = Case::new(MAKES_VENV);
        assert!(case.prepare().unwrap().ends_with("venv/bin/python"));
        assert_eq!(case.installations(), 1);
        case.prepare().unwrap();
        assert_eq!(case.installations(), 1, "it is there already");
        fs::write(
            case.directory.path().join("requirements.txt"),
            "pymodbus==3.1\n",
        )
        .unwrap();
        case.prepare().unwrap();
        assert_eq!(case.installations(), 2, "other versions are wanted");
    }

    #[test]
    fn no_python_or_an_old_one_is_told() {
        let case = Case::new("exit 1");
        let text = case.prepare().unwrap_err().to_string();
        assert!(text.contains("Python 3.10"), "{text}");
        let requirements = case.directory.path().join("requirements.txt");
        let nowhere = prepare(
            "no-python-here",
            &case.directory.path().join("v"),
            &requirements,
        );
        assert!(nowhere.unwrap_err().to_string().contains("Python 3.10"));
    }

    #[test]
    fn without_mbpoll_the_step_is_skipped_with_the_package_to_install_but_failed_in_ci() {
        let missing = find("no-mbpoll-here").unwrap_err();
        assert!(missing.to_string().contains("apt-get install mbpoll"));
        assert_eq!(
            lacking(&missing, false),
            Outcome::Skipped(missing.to_string())
        );
        assert_eq!(
            lacking(&missing, true),
            Outcome::Failed(missing.to_string())
        );
        let directory = tempfile::tempdir().unwrap();
        let there = program(directory.path(), MBPOLL, "[ \"$1\" = -V ]");
        assert_eq!(find(&there.to_string_lossy()), Ok(()));
    }

    #[test]
    fn no_venv_module_is_told_with_the_package() {
        let case = Case::new("[ \"$2\" = venv ] && { echo no ensurepip >&2; exit 1; }; exit 0");
        let text = case.prepare().unwrap_err().to_string();
        assert!(
            text.contains("python3-venv") && text.contains("no ensurepip"),
            "{text}"
        );
    }
}
