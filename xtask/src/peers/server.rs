//! The servers: the programs and versions they need, and how they are started.

use std::io::{BufRead as _, BufReader, Lines};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, ExitStatus, Stdio};

use anyhow::{Context as _, Result};
use clap::ValueEnum;

use crate::workspace::{Workspace, locked};
use crate::{command, pymodbus};

/// Returns the directory in which the servers are built.
pub fn directory(workspace: &Workspace) -> PathBuf {
    workspace.target().join("peers")
}

/// A server.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Peer {
    Libmodbus,
    ModbusCore,
    Pymodbus,
    Rmodbus,
}

/// A server that can be started.
#[derive(Debug)]
pub struct Prepared {
    /// Name in the table.
    pub name: &'static str,
    /// Version of the library.
    pub version: String,
    /// The program.
    pub program: PathBuf,
    /// The first arguments; the port follows.
    pub arguments: Vec<PathBuf>,
}

impl Peer {
    /// All servers, in the order of the table.
    pub const ALL: &[Self] = &[
        Self::Libmodbus,
        Self::ModbusCore,
        Self::Pymodbus,
        Self::Rmodbus,
    ];

    /// Returns the name in the table.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Libmodbus => "libmodbus",
            Self::ModbusCore => "modbus-core",
            Self::Pymodbus => "pymodbus",
            Self::Rmodbus => "rmodbus",
        }
    }

    /// Prepares the server. Those in Rust are built already, and are in the directory `built`.
    pub fn prepare(self, workspace: &Workspace, built: &Path) -> Result<Prepared> {
        let name = self.name();
        let prepared = |version: &str, program, arguments| Prepared {
            name,
            version: version.trim().to_owned(),
            program,
            arguments,
        };
        let peers = workspace.root().join("tools/peers");
        match self {
            Self::Libmodbus => {
                let mut pkg_config = Command::new("pkg-config");
                pkg_config.args(["--cflags", "--libs", "libmodbus"]);
                let flags = command::read(&mut pkg_config).context(
                    "libmodbus is not installed (on Debian: apt-get install gcc pkg-config libmodbus-dev)",
                )?;
                let program = directory(workspace).join("peer-libmodbus");
                let mut cc = Command::new("cc");
                cc.args(["-Wall", "-Wextra", "-Werror", "-o"]).arg(&program);
                cc.arg(peers.join("libmodbus.c"));
                command::run(cc.args(flags.split_whitespace()))?;
                let version = command::read(Command::new(&program).arg("--version"))?;
                Ok(prepared(&version, program, Vec::new()))
            }
            Self::Pymodbus => {
                let python = pymodbus::environment(workspace)?;
                let version = "import pymodbus; print(pymodbus.__version__)";
                let version = command::read(Command::new(&python).args(["-c", version]))?;
                // -B: leaves no __pycache__ in the tree.
                let arguments = vec!["-B".into(), peers.join("pymodbus_server.py")];
                Ok(prepared(&version, python, arguments))
            }
            Self::ModbusCore | Self::Rmodbus => {
                let version = locked_version(&peers.join("Cargo.lock"), name)?;
                let program = built.join(format!("peer-{name}"));
                Ok(prepared(&version, program, Vec::new()))
            }
        }
    }
}

/// Returns the version of a package in a Cargo.lock.
pub fn locked_version(lock: &Path, name: &str) -> Result<String> {
    let packages = locked(lock, "version")?;
    let version = packages
        .into_iter()
        .find(|((package, _), _)| package == name);
    let version = version.with_context(|| format!("{} has no {name}", lock.display()))?;
    Ok(version.1)
}

/// A program that runs in parallel to this one, and is killed when this value is dropped.
pub struct Started {
    name: String,
    child: Child,
    lines: Lines<BufReader<ChildStdout>>,
}

impl Started {
    /// Starts a program that prints a few lines when it is ready.
    pub fn new(mut command: Command) -> Result<Self> {
        let name = command.get_program().to_string_lossy().into_owned();
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        // The suite reports the bad frames that a server logs, so its log is not shown.
        let child = command.stderr(Stdio::null()).spawn();
        let mut child = child.map_err(|error| command::no_start(&command, error))?;
        let stdout = child.stdout.take().context("no output")?;
        let lines = BufReader::new(stdout).lines();
        Ok(Self { name, child, lines })
    }

    /// Returns the next line that the program prints.
    pub fn line(&mut self) -> Result<String> {
        let line = self.lines.next().transpose()?;
        line.with_context(|| format!("{} has ended at its start", self.name))
    }

    /// Returns the exit status, if the program has ended.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().ok().flatten()
    }
}

impl Drop for Started {
    fn drop(&mut self) {
        // An error means that the program has already ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
