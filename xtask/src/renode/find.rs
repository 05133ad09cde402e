//! Finds Renode on this machine and checks its version.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, ensure};
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

/// The usual directories of Renode on Linux and macOS.
const USUAL: [&str; 4] = [
    "/Applications/Renode.app/Contents/MacOS",
    "/opt/homebrew/bin",
    "/opt/renode",
    "/usr/local/bin",
];

/// A Renode that can be used.
#[derive(Clone, Debug)]
pub struct Renode {
    /// The program.
    pub program: PathBuf,
    /// Its version.
    pub version: Version,
}

/// Returns the directories of the PATH, followed by the usual directories of Renode.
fn places() -> Vec<PathBuf> {
    let path = env::var_os("PATH").unwrap_or_default();
    let mut places: Vec<PathBuf> = env::split_paths(&path).collect();
    places.extend(USUAL.map(PathBuf::from));
    // Windows has these variables.
    for base in ["ProgramFiles", "ProgramFiles(x86)", "LOCALAPPDATA"] {
        let bases = env::var_os(base).map(PathBuf::from).into_iter();
        places.extend(bases.flat_map(|base| [base.join("Renode/bin"), base.join("Renode")]));
    }
    // The directories that Renode's manual suggests for the portable archive.
    let home = env::home_dir().into_iter();
    places.extend(home.flat_map(|home| [home.join("renode_portable"), home.join("renode")]));
    places
}

/// Searches directories for a program of one of these names.
fn search(names: &[&str], directories: Vec<PathBuf>) -> Option<PathBuf> {
    let path = env::join_paths(directories).ok()?;
    let found = |name| which::which_in(name, Some(&path), ".").ok();
    names.iter().find_map(found)
}

impl Renode {
    /// Finds Renode at the place that the user `asked` for, else on the PATH and at the usual places.
    pub fn find(asked: Option<&Path>) -> Result<Self> {
        let program = if let Some(place) = asked {
            let directories = vec![place.to_owned(), place.join("Contents/MacOS")];
            let file = place.is_file().then(|| place.to_owned());
            file.or_else(|| search(&NAMES, directories))
                .ok_or_else(|| usage(format!("there is no Renode at {}", place.display())))?
        } else {
            search(&NAMES, places())
                .with_context(|| format!("Renode is not installed: {GET_IT}"))?
        };
        let program = std::path::absolute(program)?;
        let output = command::output(Command::new(&program).arg("--version"))?;
        let text = [output.stdout.as_slice(), &output.stderr].concat();
        let version = version(&String::from_utf8_lossy(&text)).with_context(|| {
            let (program, why) = (program.display(), command::complaint(&output));
            format!("{program} does not report its version: {why}")
        })?;
        let shown = program.display();
        ensure!(
            version >= OLDEST,
            "Renode {version} at {shown} is too old: {GET_IT}"
        );
        Ok(Self { program, version })
    }

    /// Returns the program that runs suites: in the directory of Renode, or on the PATH.
    pub fn tester(&self) -> Result<PathBuf> {
        // A link in a directory of the PATH points to the directory that has both programs. On Windows the program may
        // be in a subdirectory of the scripts' directory.
        let programs = [self.program.clone(), self.program.canonicalize()?];
        let beside = programs
            .iter()
            .flat_map(|program| program.ancestors().skip(1).take(2));
        let beside = beside.map(Path::to_owned).chain(places());
        search(&["renode-test"], beside.collect()).with_context(|| {
            let program = self.program.display();
            format!("there is no renode-test beside {program}: install the whole package or archive of Renode")
        })
    }
}

/// Returns the first version number in a text: `Renode v1.16.1.32541` is 1.16.1.
fn version(text: &str) -> Option<Version> {
    let mut words = text.split(|c: char| !(c.is_ascii_digit() || c == '.'));
    words.find_map(|word| {
        let numbers: Vec<&str> = word.split('.').take(3).collect();
        Version::parse(&numbers.join(".")).ok()
    })
}
