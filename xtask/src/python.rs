//! Virtual environments of Python under target/, for the tests that run programs written in Python.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result};
use fs_err as fs;

use crate::command;
use crate::error::Missing;

/// Requirements of a virtual environment.
#[derive(Clone, Copy, Debug)]
pub struct Environment<'a> {
    /// Name of the tests that need the environment, for messages.
    pub what: &'a str,
    /// The directory of the environment.
    pub directory: &'a Path,
    /// The files that pin its packages.
    pub requirements: &'a [PathBuf],
    /// Modules whose import shows that the packages work, separated by commas.
    pub imports: &'a str,
    /// The oldest minor version of Python 3 that the packages run on.
    pub oldest: u8,
}

impl Environment<'_> {
    /// Makes the environment, or uses an existing one with the same requirements, and returns its interpreter.
    /// The error is [`Missing`].
    pub fn prepare(&self) -> Result<PathBuf> {
        let made = self.prepare_with("python3");
        made.map_err(|error| Missing(format!("{error:#}")).into())
    }

    fn prepare_with(&self, python: &str) -> Result<PathBuf> {
        let wanted = self.requirements.iter().map(fs::read_to_string);
        let wanted: String = wanted.collect::<Result<_, _>>()?;
        let name = if cfg!(windows) {
            "Scripts/python.exe"
        } else {
            "bin/python"
        };
        let interpreter = self.directory.join(name);
        // Written last, so that an interrupted installation is not treated as a complete one.
        let stamp = self.directory.join("installed.txt");
        let import = format!("import {}", self.imports);
        let works = || command::read(Command::new(&interpreter).args(["-c", &import]));
        if fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) && works().is_ok()
        {
            return Ok(interpreter);
        }
        let Self { what, oldest, .. } = self;
        let version = format!("import sys; sys.exit(sys.version_info < (3, {oldest}))");
        command::read(Command::new(python).args(["-c", &version])).with_context(|| {
            format!("{what} needs Python 3.{oldest} or newer as python3 on the PATH")
        })?;
        eprintln!("making {}", self.directory.display());
        let mut venv = Command::new(python);
        command::read(venv.args(["-m", "venv", "--clear"]).arg(self.directory))
            .context("no virtual environment (on Debian: apt-get install python3-venv)")?;
        let mut pip = Command::new(&interpreter);
        pip.args([
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
        ]);
        for file in self.requirements {
            pip.arg("--requirement").arg(file);
        }
        command::read(&mut pip).with_context(|| format!("{what} cannot be installed from PyPI"))?;
        fs::write(&stamp, wanted)?;
        Ok(interpreter)
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use crate::script::program;

    /// A python3 whose `-m venv` makes an interpreter that records its arguments.
    const MAKES_VENV: &str = r#"
        [ "$2" = venv ] || exit 0
        mkdir -p "$4/bin"
        printf '#!/bin/sh\necho "$@" >> "%s/calls"\n' "$4" > "$4/bin/python"
        chmod +x "$4/bin/python""#;

    /// Prepares an environment with two files of requirements in this directory.
    fn prepare(directory: &Path, script: &str) -> Result<PathBuf> {
        let at = |name| directory.join(name);
        Environment {
            what: "pymodbus",
            directory: &at("venv"),
            requirements: &[at("one.txt"), at("two.txt")],
            imports: "pymodbus, serial",
            oldest: 10,
        }
        .prepare_with(&program(directory, "python3", script).to_string_lossy())
    }

    fn directory() -> tempfile::TempDir {
        let directory = tempfile::tempdir().unwrap();
        fs::write(directory.path().join("one.txt"), "pymodbus==3.0\n").unwrap();
        fs::write(directory.path().join("two.txt"), "pillow==1.0\n").unwrap();
        directory
    }

    #[test]
    fn environment_is_made_once_and_again_for_other_versions() {
        let directory = directory();
        let calls = || fs::read_to_string(directory.path().join("venv/calls")).unwrap();
        let installations = || {
            prepare(directory.path(), MAKES_VENV).unwrap();
            calls().matches("pip install").count()
        };
        assert_eq!(installations(), 1);
        assert!(calls().contains("one.txt") && calls().contains("two.txt"));
        assert_eq!(installations(), 1, "the environment exists already");
        fs::write(directory.path().join("two.txt"), "pillow==1.1\n").unwrap();
        assert_eq!(installations(), 2, "the versions have changed");
    }

    #[test]
    fn missing_python_or_venv_is_reported_with_what_to_install() {
        let directory = directory();
        let text = |script| format!("{:#}", prepare(directory.path(), script).unwrap_err());
        assert!(text("exit 1").contains("pymodbus needs Python 3.10"));
        let venv = text("[ \"$2\" = venv ] && { echo no ensurepip >&2; exit 1; }; exit 0");
        assert!(
            venv.contains("python3-venv") && venv.contains("no ensurepip"),
            "{venv}"
        );
    }
}
