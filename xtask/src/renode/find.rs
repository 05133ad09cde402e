//! Where Renode is on this machine, and whether it is new enough.

use std::env;
use std::ffi::OsString;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use crate::{Failure, Result, command};

/// The oldest version whose Python models see accesses under the names that ours use.
const OLDEST: Version = Version(1, 16, 1);

/// Renode takes seconds to start, on a slow disk many.
const PATIENCE: Duration = Duration::from_secs(120);

/// What to do about a Renode that is missing or too old.
const GET_IT: &str = "get Renode 1.16.1 or newer from https://github.com/renode/renode/releases, or tell where it is \
    with --renode PATH or $RENODE; the simulator of `cargo xtask sim` needs none";

/// A version: major, minor, patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Version(u32, u32, u32);

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(major, minor, patch) = self;
        write!(f, "{major}.{minor}.{patch}")
    }
}

impl Version {
    /// The first version number in what `renode --version` prints.
    fn parse(text: &str) -> Option<Self> {
        text.split(|c: char| !(c.is_ascii_digit() || c == '.'))
            .find_map(|word| {
                let mut numbers = word.split('.').map_while(|part| part.parse().ok());
                Some(Self(numbers.next()?, numbers.next()?, numbers.next()?))
            })
    }
}

/// A Renode that can be used.
#[derive(Clone, Debug)]
pub struct Renode {
    program: PathBuf,
    version: Version,
}

impl fmt::Display for Renode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Renode {} at {}", self.version, self.program.display())
    }
}

/// What of the machine says where programs are.
#[derive(Clone, Debug, Default)]
pub(super) struct Surroundings {
    /// `$RENODE`
    pub(super) variable: Option<OsString>,
    /// The directories of the PATH.
    pub(super) path: Vec<PathBuf>,
    /// The directories that installers and people put Renode into.
    pub(super) usual: Vec<PathBuf>,
}

impl Surroundings {
    /// Those of this process.
    pub(super) fn of_process() -> Self {
        let path = env::var_os("PATH").unwrap_or_default();
        let mut usual: Vec<PathBuf> = if cfg!(windows) {
            ["ProgramFiles", "ProgramFiles(x86)", "LOCALAPPDATA"]
                .iter()
                .filter_map(env::var_os)
                .flat_map(|base| {
                    let base = PathBuf::from(base).join("Renode");
                    [base.join("bin"), base]
                })
                .collect()
        } else if cfg!(target_os = "macos") {
            vec![
                "/Applications/Renode.app/Contents/MacOS".into(),
                "/opt/homebrew/bin".into(),
                "/usr/local/bin".into(),
            ]
        } else {
            vec![
                "/opt/renode".into(),
                "/usr/bin".into(),
                "/usr/local/bin".into(),
            ]
        };
        // Where the portable archive is unpacked as its manual has it.
        if let Some(home) = env::home_dir() {
            usual.extend([home.join("renode_portable"), home.join("renode")]);
        }
        Self {
            variable: env::var_os("RENODE").filter(|value| !value.is_empty()),
            path: env::split_paths(&path).collect(),
            usual,
        }
    }
}

impl Renode {
    /// Finds Renode where it was `asked` for, else by `$RENODE`, the PATH, and the usual places.
    ///
    /// # Errors
    ///
    /// When it is not there, cannot be run, or is too old.
    pub(super) fn find(asked: Option<&Path>, machine: &Surroundings) -> Result<Self> {
        let named = [
            ("--renode", asked.map(Path::to_owned)),
            ("$RENODE", machine.variable.as_ref().map(PathBuf::from)),
        ];
        for (by, place) in named {
            if let Some(place) = place {
                let program = program_at(&place).ok_or_else(|| {
                    Failure::asked(format!("{by}: there is no Renode at {}", place.display()))
                })?;
                return Self::at(program);
            }
        }
        let program = machine
            .path
            .iter()
            .chain(&machine.usual)
            .find_map(|directory| program_in(directory))
            .ok_or_else(|| Failure::new(format!("Renode is not installed: {GET_IT}")))?;
        Self::at(program)
    }

    fn at(program: PathBuf) -> Result<Self> {
        let program = std::path::absolute(&program).unwrap_or(program);
        let output = command::within(PATIENCE, Command::new(&program).arg("--version"))?;
        let text = String::from_utf8_lossy(&output.stdout).into_owned()
            + &String::from_utf8_lossy(&output.stderr);
        let shown = program.display();
        let Some(version) = Version::parse(&text) else {
            let why = command::complaint(&output);
            return Err(Failure::new(format!(
                "{shown} does not tell its version: {why}"
            )));
        };
        if version < OLDEST {
            return Err(Failure::new(format!(
                "Renode {version} at {shown} is too old: {GET_IT}"
            )));
        }
        Ok(Self { program, version })
    }

    /// The command that starts it.
    pub(super) fn command(&self) -> Command {
        Command::new(&self.program)
    }

    /// The version, for reports.
    pub(super) fn version(&self) -> String {
        self.version.to_string()
    }

    /// The program that runs suites in it: beside it, or on the PATH.
    ///
    /// # Errors
    ///
    /// When it is in neither place, with what to do.
    pub(super) fn tester(&self, machine: &Surroundings) -> Result<PathBuf> {
        // A link in a directory of the PATH leads to where both are.
        let linked = self.program.canonicalize().ok();
        let beside = [Some(&self.program), linked.as_ref()];
        beside
            .into_iter()
            .flatten()
            .filter_map(|program| program.parent())
            // On Windows the program may be in a subdirectory of where the scripts are.
            .flat_map(|directory| [Some(directory), directory.parent()])
            .flatten()
            .chain(machine.path.iter().map(PathBuf::as_path))
            .find_map(|directory| file_in(directory, &["renode-test", "renode-test.bat"]))
            .ok_or_else(|| {
                let program = self.program.display();
                Failure::new(format!(
                    "there is no renode-test beside {program}: install Renode from its package or archive, whole"
                ))
            })
    }
}

/// Renode in a directory, under the names it has on the three systems.
fn program_in(directory: &Path) -> Option<PathBuf> {
    file_in(
        directory,
        if cfg!(windows) {
            &["renode.exe", "Renode.exe", "renode.bat"]
        } else {
            &["renode", "macos_run.command"]
        },
    )
}

/// Renode at a path that may be the program or its directory.
fn program_at(place: &Path) -> Option<PathBuf> {
    if place.is_file() {
        return Some(place.to_owned());
    }
    program_in(place).or_else(|| program_in(&place.join("Contents/MacOS")))
}

fn file_in(directory: &Path, names: &[&str]) -> Option<PathBuf> {
    names
        .iter()
        // On Windows the first is a script for another shell.
        .filter(|name| !cfg!(windows) || name.contains('.'))
        .map(|name| directory.join(name))
        .find(|file| file.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_found_in_what_renode_prints() {
        for (text, version) in [
            (
                "Renode v1.16.1.32541\n  build: 1a2b3c4-202602161200",
                Some(Version(1, 16, 1)),
            ),
            (
                "Renode, version 1.17.0.1234 (abcdef0-202610011234)",
                Some(Version(1, 17, 0)),
            ),
            ("10:20:30.1 [INFO] x\nRenode v2.0.0", Some(Version(2, 0, 0))),
            ("Renode", None),
            ("", None),
        ] {
            assert_eq!(Version::parse(text), version, "{text}");
        }
        assert!(Version(1, 16, 0) < OLDEST && Version(1, 15, 3) < OLDEST);
        assert!(Version(1, 16, 1) >= OLDEST && Version(2, 0, 0) >= OLDEST);
    }
}
