//! Finds Renode on this machine and checks its version.

use std::env;
use std::ffi::{OsStr, OsString};
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, bail, ensure};
use semver::Version;

use crate::command;
use crate::error::usage;

/// The oldest version in which Python models receive accesses under the names that the project's models use.
const OLDEST: Version = Version::new(1, 16, 1);

/// Advice for a Renode that is missing or too old.
const GET_IT: &str = "get Renode 1.16.1 or newer from https://github.com/renode/renode/releases, or give its place with \
    --renode PATH or $RENODE; the simulator of `cargo xtask sim` needs none";

/// Names of the program: on all systems, and in the application directory of macOS.
const NAMES: [&str; 2] = ["renode", "macos_run.command"];

/// A Renode that can be used.
#[derive(Clone, Debug)]
pub struct Renode {
    /// The program.
    pub program: PathBuf,
    /// Its version.
    pub version: Version,
}

impl fmt::Display for Renode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Renode {} at {}", self.version, self.program.display())
    }
}

/// Places where this machine may have programs.
#[derive(Clone, Debug, Default)]
pub struct Places {
    /// Value of `$RENODE`.
    pub variable: Option<PathBuf>,
    /// The directories of the PATH, followed by the usual directories of Renode.
    pub path: OsString,
}

impl Places {
    /// Returns the places of this process.
    pub fn of_process() -> Result<Self> {
        let path = env::var_os("PATH").unwrap_or_default();
        let mut path: Vec<PathBuf> = env::split_paths(&path).collect();
        if cfg!(windows) {
            for base in ["ProgramFiles", "ProgramFiles(x86)", "LOCALAPPDATA"] {
                let base = env::var_os(base).map(|base| PathBuf::from(base).join("Renode"));
                path.extend(base.into_iter().flat_map(|base| [base.join("bin"), base]));
            }
        } else {
            path.extend(
                [
                    "/Applications/Renode.app/Contents/MacOS",
                    "/opt/homebrew/bin",
                    "/opt/renode",
                    "/usr/local/bin",
                ]
                .map(PathBuf::from),
            );
        }
        // The directories that Renode's manual suggests for the portable archive.
        let home = env::home_dir().into_iter();
        path.extend(home.flat_map(|home| [home.join("renode_portable"), home.join("renode")]));
        Ok(Self {
            variable: env::var_os("RENODE")
                .filter(|value| !value.is_empty())
                .map(PathBuf::from),
            path: env::join_paths(path)?,
        })
    }
}

/// Searches directories for a program of one of these names.
fn search(names: &[&str], path: &OsStr) -> Option<PathBuf> {
    let found = |name| which::which_in(name, Some(path), ".").ok();
    names.iter().find_map(found)
}

impl Renode {
    /// Finds Renode at the place that the user `asked` for, else by `$RENODE`, the PATH, and the usual places.
    pub fn find(asked: Option<&Path>, places: &Places) -> Result<Self> {
        let named = [("--renode", asked), ("$RENODE", places.variable.as_deref())];
        for (by, place) in named {
            if let Some(place) = place {
                let path = env::join_paths([place.to_owned(), place.join("Contents/MacOS")])?;
                let file = place.is_file().then(|| place.to_owned());
                let program = file.or_else(|| search(&NAMES, &path)).ok_or_else(|| {
                    usage(format!("{by}: there is no Renode at {}", place.display()))
                });
                return Self::at(program?);
            }
        }
        let program = search(&NAMES, &places.path);
        Self::at(program.with_context(|| format!("Renode is not installed: {GET_IT}"))?)
    }

    fn at(program: PathBuf) -> Result<Self> {
        let program = std::path::absolute(program)?;
        let output = command::output(Command::new(&program).arg("--version"))?;
        let text = [output.stdout.as_slice(), &output.stderr].concat();
        let shown = program.display();
        let Some(version) = version(&String::from_utf8_lossy(&text)) else {
            bail!(
                "{shown} does not report its version: {}",
                command::complaint(&output)
            );
        };
        ensure!(
            version >= OLDEST,
            "Renode {version} at {shown} is too old: {GET_IT}"
        );
        Ok(Self { program, version })
    }

    /// Returns the program that runs suites: in the directory of Renode, or on the PATH.
    pub fn tester(&self, places: &Places) -> Result<PathBuf> {
        // A link in a directory of the PATH points to the directory that has both programs.
        let linked = self.program.canonicalize();
        let programs = [Some(self.program.clone()), linked.ok()];
        // On Windows the program may be in a subdirectory of the scripts' directory.
        let beside = programs
            .iter()
            .flatten()
            .flat_map(|program| program.ancestors().skip(1).take(2));
        let path = beside
            .map(Path::to_owned)
            .chain(env::split_paths(&places.path));
        search(&["renode-test"], &env::join_paths(path)?).with_context(|| {
            let program = self.program.display();
            format!("there is no renode-test beside {program}: install the whole package or archive of Renode")
        })
    }
}

/// Returns the first version number in a text: `Renode v1.16.1.32541` is 1.16.1.
fn version(text: &str) -> Option<Version> {
    text.split(|c: char| !(c.is_ascii_digit() || c == '.'))
        .find_map(|word| {
            let mut numbers = word.split('.').map_while(|part| part.parse().ok());
            Some(Version::new(
                numbers.next()?,
                numbers.next()?,
                numbers.next()?,
            ))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn version_is_found_in_the_output_of_renode() {
        for (text, expected) in [
            (
                "Renode v1.16.1.32541\n  build: 1a2b3c4-202602161200",
                Some((1, 16, 1)),
            ),
            (
                "Renode, version 1.17.0.1234 (abcdef0-202610011234)",
                Some((1, 17, 0)),
            ),
            ("10:20:30.1 [INFO] x\nRenode v2.0.0", Some((2, 0, 0))),
            ("Renode", None),
        ] {
            let expected = expected.map(|(major, minor, patch)| Version::new(major, minor, patch));
            assert_eq!(version(text), expected, "{text}");
        }
    }
}
