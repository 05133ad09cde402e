//! The project on this machine: its directories, and how cargo is called.

use std::collections::BTreeMap;
use std::env;
use std::path::{self, Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result};
use cargo_metadata::{Artifact, Message, MetadataCommand, PackageId};

use crate::command;
use crate::sources::Sources;
use crate::toolchain::{self, Machine, Way};

/// The project on this machine.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    /// The directory of the root Cargo.toml.
    pub root: PathBuf,
    /// Cargo's target directory.
    pub target: PathBuf,
    way: Option<Way>,
    /// Further arguments of every cargo.
    arguments: Vec<String>,
    /// Whether missing Debian packages may be installed.
    pub install: bool,
    /// Whether host tests leave out the simulator.
    pub host: bool,
    /// The file with the public keys that the loader trusts: that of the variable `MODIO_KEYS`, or of a release. Without
    /// it `loader/build.rs` takes the development keys.
    pub keys: Option<PathBuf>,
}

/// Returns the directory of the root Cargo.toml: of the checkout in which cargo runs xtask, which may be a copy of the
/// one that it was built from.
fn root() -> Result<PathBuf> {
    // Cargo sets the variable when it runs a program.
    if let Some(package) = env::var_os("CARGO_MANIFEST_DIR") {
        let package = PathBuf::from(package);
        return Ok(package.parent().unwrap_or(&package).to_owned());
    }
    let mut cargo = Command::new(toolchain::cargo());
    cargo.args(["locate-project", "--workspace", "--message-format=plain"]);
    let manifest = PathBuf::from(command::read(&mut cargo)?.trim_end());
    let directory = manifest.parent().context("Cargo.toml has no directory")?;
    Ok(directory.to_owned())
}

impl Workspace {
    /// Finds the project in which xtask was called, and cargo's target directory.
    pub fn open() -> Result<Self> {
        let root = root()?;
        let offline = ["--offline".to_owned()];
        let mut metadata = MetadataCommand::new();
        metadata.current_dir(&root).no_deps().other_options(offline);
        Ok(Self {
            target: metadata.exec()?.target_directory.into(),
            root,
            // Of this directory. The build would look for it in the directory of the loader.
            keys: env::var_os("MODIO_KEYS").map(path::absolute).transpose()?,
            ..Self::default()
        })
    }

    /// Returns what the sources are now.
    pub fn sources(&self) -> Result<Sources> {
        Sources::of(&self.root)
    }

    /// Returns the same project with another target directory, and with further arguments of every cargo.
    pub fn with(&self, target: PathBuf, arguments: Vec<String>) -> Self {
        Self {
            target,
            arguments,
            ..self.clone()
        }
    }

    /// Returns cargo for the host, run at the root.
    pub fn cargo(&self, subcommand: &str) -> Command {
        let mut cargo = Command::new(toolchain::cargo());
        cargo.current_dir(&self.root).arg(subcommand);
        cargo.args(&self.arguments);
        cargo
    }

    /// Returns cargo for the host that builds a separate workspace in `directory` of the target directory.
    pub fn other(&self, subcommand: &str, manifest: &str, directory: &str) -> Command {
        let mut cargo = self.cargo(subcommand);
        cargo.args(["--locked", "--manifest-path", manifest]);
        cargo.arg("--target-dir").arg(self.target.join(directory));
        cargo
    }

    /// Returns cargo for the microcontroller, run at the root. The way to compile for it is searched only once.
    pub fn target_cargo(&mut self, subcommand: &str) -> Result<Command> {
        let way = match self.way {
            Some(way) => way,
            None => *self.way.insert(Machine::default().find(self.install)?),
        };
        let mut cargo = way.cargo(subcommand);
        cargo.current_dir(&self.root).args(&self.arguments);
        Ok(cargo)
    }

    /// Builds a program of this workspace for the host, and returns its path.
    pub fn program(&self, program: &str) -> Result<PathBuf> {
        let mut cargo = self.cargo("build");
        cargo.args(ALL).args(["--bin", program]);
        executable(&artifacts(&mut cargo)?, program)
    }

    /// Builds the simulator and returns its path.
    pub fn simulator(&self) -> Result<PathBuf> {
        self.program("modio-sim")
    }
}

/// The options with which cargo builds parts of the workspace for the host.
///
/// All packages are selected, whatever is built: with a single package, dependencies would have fewer features, and the
/// simulator's core, which takes minutes, would be built once more. This core, crate rigless, declares a newer rustc
/// than it needs.
pub const ALL: [&str; 2] = ["--workspace", "--ignore-rust-version"];

/// The feature with which the conformance suite contains the simulator. All tests are built with it, so that nothing is
/// built twice.
pub const SUITE: &str = "conformance/sim";

/// Runs a build of cargo, which shows its progress, and returns its products.
pub fn artifacts(cargo: &mut Command) -> Result<Vec<Artifact>> {
    cargo.arg("--message-format=json-render-diagnostics");
    let output = command::output(cargo.stderr(Stdio::inherit()))?;
    command::succeeded(cargo, output.status)?;
    let mut artifacts = Vec::new();
    for message in Message::parse_stream(output.stdout.as_slice()) {
        if let Message::CompilerArtifact(artifact) = message? {
            artifacts.push(artifact);
        }
    }
    Ok(artifacts)
}

/// Returns the packages that were compiled into one of these directories.
pub fn packages(artifacts: &[Artifact], directories: &[PathBuf]) -> Vec<PackageId> {
    let compiled = artifacts.iter().filter(|artifact| {
        let is_in = |directory: &PathBuf| {
            let mut files = artifact.filenames.iter();
            files.any(|file| file.starts_with(directory))
        };
        directories.iter().any(is_in)
    });
    compiled.map(|built| built.package_id.clone()).collect()
}

/// Returns the file of a program that was built.
pub fn executable(artifacts: &[Artifact], program: &str) -> Result<PathBuf> {
    // A library may have the same name.
    let built = artifacts
        .iter()
        .filter(|built| built.target.name == program);
    let file = built.filter_map(|built| built.executable.clone()).next();
    let file = file.with_context(|| format!("cargo has built no program {program}"))?;
    Ok(file.into())
}

/// Returns a field of the packages in a Cargo.lock, by name and version. Packages without the field are left out.
pub fn locked(lock: &Path, field: &str) -> Result<BTreeMap<(String, String), String>> {
    let table: toml::Table = fs_err::read_to_string(lock)?.parse()?;
    let packages = table.get("package").and_then(toml::Value::as_array);
    let fields = packages.into_iter().flatten().filter_map(|package| {
        let text = |name| Some(package.get(name)?.as_str()?.to_owned());
        Some(((text("name")?, text("version")?), text(field)?))
    });
    Ok(fields.collect())
}
