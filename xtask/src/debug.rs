//! `cargo xtask run`, `attach` and `gdb`: the image that runs without a loader, on the board at a debug probe, through
//! probe-rs. Without a probe, `run` and `gdb` use the simulator.

use std::ffi::OsString;
use std::io;
use std::net::{Ipv4Addr, TcpListener};
use std::path::Path;
use std::process::{Command, Output};

use anyhow::{Context as _, Result, anyhow, ensure};

use crate::group::Group;
use crate::workspace::Workspace;
use crate::{build, command};

/// GDBs that may support Arm, the likely ones first.
const GDBS: [&str; 3] = ["arm-none-eabi-gdb", "gdb-multiarch", "gdb"];

/// The image and the board.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    #[command(flatten)]
    pub given: build::Given,

    /// The part, as `probe-rs chip list` names it [default: that of the board]
    #[arg(long, value_name = "CHIP")]
    chip: Option<String>,

    /// The debug probe, when there are several: VID:PID or VID:PID:SERIAL, as `probe-rs list` shows it
    #[arg(long, value_name = "SELECTOR")]
    probe: Option<String>,
}

/// Additional options of `cargo xtask gdb`.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct GdbOptions {
    #[command(flatten)]
    board: Options,

    /// The GDB [default: the first installed of arm-none-eabi-gdb, gdb-multiarch and gdb]
    #[arg(long, value_name = "PROGRAM")]
    gdb: Option<String>,

    /// Arguments for GDB, such as -ex 'break main'
    #[arg(last = true)]
    arguments: Vec<OsString>,
}

/// `cargo xtask run`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let has_probe = options.has_probe()?;
    let elf = options.given.elf(workspace)?;
    if has_probe {
        return command::exec(options.probe_rs("run").arg("--verify").arg(elf));
    }
    command::exec(&mut options.simulator(workspace, &elf)?)
}

/// `cargo xtask attach`.
pub fn attach(workspace: &mut Workspace, options: &Options) -> Result<()> {
    check()?;
    let elf = options.given.elf(workspace)?;
    command::exec(options.probe_rs("attach").arg(elf))
}

/// `cargo xtask gdb`.
pub fn gdb(workspace: &mut Workspace, options: &GdbOptions) -> Result<()> {
    let knows_arm = |gdb: &&str| {
        let try_it = ["-nx", "-batch", "-ex", "set architecture arm"];
        command::read(Command::new(gdb).args(try_it)).is_ok()
    };
    let installed = || GDBS.into_iter().find(knows_arm);
    let gdb = options.gdb.as_deref().or_else(installed).context(
        "no GDB for Arm is installed (on Debian: apt-get install gdb-multiarch); --gdb names another one",
    )?;
    let board = &options.board;
    let has_probe = board.has_probe()?;
    let elf = board.given.elf(workspace)?;
    let address = format!("127.0.0.1:{}", free_port()?);
    let mut server;
    if has_probe {
        board.write(&elf)?;
        server = board.probe_rs("gdb");
        server.args(["--gdb-connection-string", &address]);
    } else {
        server = board.simulator(workspace, &elf)?;
        server.args(["--http", "127.0.0.1:0", "--gdb", &address]);
    }
    // From here on Ctrl-C does not end xtask, and GDB halts the core.
    let _server = Group::start(server)?;
    let mut gdb = Command::new(gdb);
    // GDB tries to connect until the server is ready.
    gdb.arg(elf).args(["-ex", "set tcp connect-timeout 30"]);
    gdb.args(["-ex", &format!("target extended-remote {address}")]);
    command::run(gdb.args(&options.arguments))
}

/// Returns a TCP port that is free.
pub fn free_port() -> Result<u16> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).context("no free TCP port")?;
    Ok(listener.local_addr()?.port())
}

/// Fails when probe-rs is not installed or sees no probe.
pub fn check() -> Result<()> {
    check_list(Command::new("probe-rs").arg("list").output())
}

/// Checks the output of `probe-rs list`. If it is an error, the next call of probe-rs fails and reports it.
fn check_list(list: io::Result<Output>) -> Result<()> {
    let list = list.map_err(|_| {
        anyhow!(
            "probe-rs is not installed: `cargo install probe-rs-tools --locked`, or see \
             https://probe.rs/docs/getting-started/installation"
        )
    })?;
    let text = [list.stdout, list.stderr].concat();
    let text = String::from_utf8_lossy(&text).to_lowercase();
    ensure!(
        !text.contains("no debug probes were found"),
        "no debug probe found: connect one (ST-Link, CMSIS-DAP, J-Link) to USB; on Linux it may need the udev rules of \
         https://probe.rs/docs/getting-started/probe-setup"
    );
    Ok(())
}

impl Options {
    /// Returns probe-rs with the part and the probe.
    pub fn probe_rs(&self, subcommand: &str) -> Command {
        let part = self.given.board().memory.part.name;
        let mut command = Command::new("probe-rs");
        command.args([subcommand, "--chip", self.chip.as_deref().unwrap_or(part)]);
        if let Some(probe) = &self.probe {
            command.args(["--probe", probe]);
        }
        command
    }

    /// Returns the simulator with the board and an image.
    fn simulator(&self, workspace: &Workspace, elf: &Path) -> Result<Command> {
        let mut simulator = Command::new(workspace.simulator()?);
        simulator.args(["--board", self.given.board().name, "--elf"]);
        simulator.arg(elf);
        Ok(simulator)
    }

    /// Returns whether there is a probe, or the simulator is to be used instead. A probe that the options need is an
    /// error when it is missing.
    fn has_probe(&self) -> Result<bool> {
        let needed = self.probe.is_some() || self.chip.is_some();
        match check() {
            Err(error) if !needed => {
                eprintln!("xtask: using the simulator: {error:#}");
                Ok(false)
            }
            checked => checked.map(|()| true),
        }
    }

    fn write(&self, elf: &Path) -> Result<()> {
        command::run(self.probe_rs("download").arg("--verify").arg(elf))?;
        command::run(&mut self.probe_rs("reset"))
    }
}

#[cfg(test)]
mod tests {
    use std::process::ExitStatus;

    use super::*;

    #[test]
    fn missing_probe_and_missing_probe_rs_are_distinguished() {
        let list = |text: &str| {
            let (status, stdout, stderr) = (ExitStatus::default(), text.into(), Vec::new());
            check_list(Ok(Output {
                status,
                stdout,
                stderr,
            }))
        };
        assert!(list("[0]: ST-Link V2 (VID: 0483, PID: 3748)").is_ok());
        let none = list("No debug probes were found.").unwrap_err();
        assert!(none.to_string().contains("connect one"));
        let missing = check_list(Err(io::ErrorKind::NotFound.into())).unwrap_err();
        assert!(missing.to_string().contains("cargo install"));
    }
}
