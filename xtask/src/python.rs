//! Virtual environments of Python under target/, for the tests that drive programs written in it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::{Failure, Result, command};

/// What a virtual environment has to offer.
#[derive(Clone, Copy, Debug)]
pub struct Environment<'a> {
    /// What needs it, for messages.
    pub what: &'a str,
    /// The directory that it is made in.
    pub directory: &'a Path,
    /// The files that pin its packages.
    pub requirements: &'a [PathBuf],
    /// Modules whose import shows that the packages work, separated by commas.
    pub imports: &'a str,
    /// The oldest minor version of Python 3 that the packages run on.
    pub oldest: u8,
}

impl Environment<'_> {
    /// Makes the environment, or takes the one made earlier from the same requirements, and returns its interpreter.
    ///
    /// # Errors
    ///
    /// When Python or its module venv is missing, or PyPI cannot be reached, with what to install.
    pub fn prepare(&self) -> Result<PathBuf> {
        self.prepare_with("python3")
    }

    fn prepare_with(&self, python: &str) -> Result<PathBuf> {
        let wanted = self
            .requirements
            .iter()
            .map(|file| {
                fs::read_to_string(file).map_err(|error| {
                    Failure::new(format!("cannot read {}: {error}", file.display()))
                })
            })
            .collect::<Result<String>>()?;
        let interpreter = self.directory.join(if cfg!(windows) {
            "Scripts/python.exe"
        } else {
            "bin/python"
        });
        // Written last, so that an installation cut short is not mistaken for a whole one.
        let stamp = self.directory.join("installed.txt");
        let import = format!("import {}", self.imports);
        let works = || command::read(Command::new(&interpreter).args(["-c", &import]));
        if fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) && works().is_ok()
        {
            return Ok(interpreter);
        }
        let Self { what, oldest, .. } = self;
        let version = format!("import sys; sys.exit(sys.version_info < (3, {oldest}))");
        command::read(Command::new(python).args(["-c", &version])).map_err(|_| {
            Failure::new(format!(
                "{what} needs Python 3.{oldest} or newer as python3 on the PATH"
            ))
        })?;
        eprintln!("making {}", self.directory.display());
        command::read(
            Command::new(python)
                .args(["-m", "venv", "--clear"])
                .arg(self.directory),
        )
        .map_err(|why| {
            Failure::new(format!(
                "no virtual environment (on Debian: python3-venv): {why}"
            ))
        })?;
        let mut pip = Command::new(&interpreter);
        pip.args(["-m", "pip", "install", "--quiet"]);
        pip.arg("--disable-pip-version-check");
        for file in self.requirements {
            pip.arg("--requirement").arg(file);
        }
        command::read(&mut pip)
            .map_err(|why| Failure::new(format!("{what} cannot be installed from PyPI: {why}")))?;
        fs::write(&stamp, wanted)
            .map_err(|error| Failure::new(format!("cannot write {}: {error}", stamp.display())))?;
        Ok(interpreter)
    }
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
            fs::write(directory.path().join("one.txt"), "pymodbus==3.0\n").unwrap();
            fs::write(directory.path().join("two.txt"), "pillow==1.0\n").unwrap();
            Self { directory, python }
        }

        fn prepare(&self) -> Result<PathBuf> {
            self.prepare_with(&self.python.to_string_lossy())
        }

        fn prepare_with(&self, python: &str) -> Result<PathBuf> {
            let at = |name| self.directory.path().join(name);
            Environment {
                what: "pymodbus",
                directory: &at("venv"),
                requirements: &[at("one.txt"), at("two.txt")],
                imports: "pymodbus, serial",
                oldest: 10,
            }
            .prepare_with(python)
        }

        fn calls(&self) -> String {
            fs::read_to_string(self.directory.path().join("venv/calls")).unwrap_or_default()
        }

        fn installations(&self) -> usize {
            self.calls().matches("pip install").count()
        }
    }

    #[test]
    fn environment_is_made_once_and_again_for_other_versions() {
        let case = Case::new(MAKES_VENV);
        assert!(case.prepare().unwrap().ends_with("venv/bin/python"));
        assert_eq!(case.installations(), 1);
        let calls = case.calls();
        assert!(calls.contains("one.txt") && calls.contains("two.txt"));
        case.prepare().unwrap();
        assert_eq!(case.installations(), 1, "the environment exists already");
        fs::write(case.directory.path().join("two.txt"), "pillow==1.1\n").unwrap();
        case.prepare().unwrap();
        assert_eq!(case.installations(), 2, "other versions are wanted");
    }

    #[test]
    fn missing_or_old_python_is_reported_with_the_version_needed() {
        let case = Case::new("exit 1");
        for python in [case.python.to_str().unwrap(), "no-python-here"] {
            let text = case.prepare_with(python).unwrap_err().to_string();
            assert!(text.contains("pymodbus needs Python 3.10"), "{text}");
        }
    }

    #[test]
    fn missing_venv_module_is_reported_with_its_package() {
        let case = Case::new("[ \"$2\" = venv ] && { echo no ensurepip >&2; exit 1; }; exit 0");
        let text = case.prepare().unwrap_err().to_string();
        assert!(
            text.contains("python3-venv") && text.contains("no ensurepip"),
            "{text}"
        );
    }
}
