//! The servers: what each takes, and how it is started.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use crate::workspace::Workspace;
use crate::{Failure, Result, command, pymodbus};

/// Where the servers are built.
pub(super) fn directory(workspace: &Workspace) -> PathBuf {
    workspace.target().join("peers")
}

/// A server.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Peer {
    Libmodbus,
    ModbusCore,
    Pymodbus,
    Rmodbus,
}

/// A server that can be started.
#[derive(Debug)]
pub(super) struct Prepared {
    /// Version of the library.
    pub version: String,
    /// The program and its first arguments; the port follows.
    pub command: Vec<PathBuf>,
}

impl Peer {
    /// All servers, in the order of the table.
    pub const ALL: [Self; 4] = [
        Self::Libmodbus,
        Self::ModbusCore,
        Self::Pymodbus,
        Self::Rmodbus,
    ];

    /// Its name in the table.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Libmodbus => "libmodbus",
            Self::ModbusCore => "modbus-core",
            Self::Pymodbus => "pymodbus",
            Self::Rmodbus => "rmodbus",
        }
    }

    /// Gets the server ready; the Rust ones have been built.
    ///
    /// # Errors
    ///
    /// What is missing, and how to install it.
    pub fn prepare(self, workspace: &Workspace) -> Result<Prepared> {
        match self {
            Self::Libmodbus => libmodbus(workspace, "pkg-config"),
            Self::Pymodbus => {
                let python = pymodbus::environment(workspace)?;
                let version = "import pymodbus; print(pymodbus.__version__)";
                let version = command::read(Command::new(&python).args(["-c", version]))?;
                let script = workspace.root().join("tools/peers/pymodbus_server.py");
                Ok(Prepared {
                    version: version.trim().to_owned(),
                    // -B: leaves no __pycache__ in the tree.
                    command: vec![python, "-B".into(), script],
                })
            }
            Self::ModbusCore | Self::Rmodbus => {
                let lock = workspace.root().join("tools/peers/Cargo.lock");
                let text = fs::read_to_string(&lock).map_err(|error| {
                    Failure::new(format!("cannot read {}: {error}", lock.display()))
                })?;
                let version = locked_version(&text, self.name()).ok_or_else(|| {
                    Failure::new(format!("{} is not in {}", self.name(), lock.display()))
                })?;
                let program = format!("debug/peer-{}", self.name());
                Ok(Prepared {
                    version,
                    command: vec![directory(workspace).join(program)],
                })
            }
        }
    }
}

/// Compiles the server on libmodbus.
pub(super) fn libmodbus(workspace: &Workspace, pkg_config: &str) -> Result<Prepared> {
    let flags = command::read(Command::new(pkg_config).args(["--cflags", "--libs", "libmodbus"]))
        .map_err(|_| {
        Failure::new(
            "libmodbus is not installed (on Debian: apt-get install gcc pkg-config libmodbus-dev)",
        )
    })?;
    let program = directory(workspace).join("peer-libmodbus");
    command::run(
        Command::new("cc")
            .args(["-Wall", "-Wextra", "-Werror", "-o"])
            .arg(&program)
            .arg(workspace.root().join("tools/peers/libmodbus.c"))
            .args(flags.split_whitespace()),
    )?;
    let version = command::read(Command::new(&program).arg("--version"))?;
    Ok(Prepared {
        version: version.trim().to_owned(),
        command: vec![program],
    })
}

/// The version of a package in a Cargo.lock.
pub(super) fn locked_version(lock: &str, name: &str) -> Option<String> {
    let (_, package) = lock.split_once(&format!("name = \"{name}\"\nversion = \""))?;
    Some(package.split_once('"')?.0.to_owned())
}

/// A program that runs beside this one, and ends with this value.
pub(super) struct Started {
    name: String,
    child: Child,
    lines: Receiver<String>,
    patience: Duration,
}

impl Started {
    /// Starts a program that prints lines, each within `patience`.
    pub fn new(command: &mut Command, patience: Duration) -> Result<Self> {
        let name = command.get_program().to_string_lossy().into_owned();
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            // What a server logs about each bad frame says nothing that the suite does not.
            .stderr(Stdio::null())
            .spawn()
            .map_err(|error| Failure::new(format!("{name} cannot be run: {error}")))?;
        let (send, lines) = channel();
        if let Some(stdout) = child.stdout.take() {
            thread::spawn(move || {
                let lines = BufReader::new(stdout).lines().map_while(|line| line.ok());
                // Reads on when nobody wants the lines any more: a full pipe would stop the program.
                lines.for_each(|line| drop(send.send(line)));
            });
        }
        Ok(Self {
            name,
            child,
            lines,
            patience,
        })
    }

    /// The next line that it prints.
    pub fn line(&mut self) -> Result<String> {
        self.lines.recv_timeout(self.patience).map_err(|error| {
            let why = match error {
                RecvTimeoutError::Timeout => "does not say that it is ready",
                RecvTimeoutError::Disconnected => "has ended at its start",
            };
            Failure::new(format!("{} {why}", self.name))
        })
    }

    /// How it ended, if it has.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().ok().flatten()
    }
}

impl Drop for Started {
    fn drop(&mut self) {
        // It has ended already when this fails.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
