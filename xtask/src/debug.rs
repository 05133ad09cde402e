//! `cargo xtask flash`, `run`, `attach` and `gdb`: the image on the board at a debug probe, through probe-rs. Without a
//! probe, `run` and `gdb` use the simulator.

use std::ffi::OsString;
use std::net::{Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, anyhow, bail};

use crate::board::{Hardware, Memory};
use crate::error::{Missing, usage};
use crate::group::Group;
use crate::workspace::Workspace;
use crate::{build, command, image, sim};

/// GDBs that may support Arm, the likely ones first.
const GDBS: [&str; 3] = ["arm-none-eabi-gdb", "gdb-multiarch", "gdb"];

/// The image and the board.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    #[command(flatten)]
    build: build::Options,

    /// The part, as `probe-rs chip list` names it [default: that of the board]
    #[arg(long, value_name = "CHIP")]
    chip: Option<String>,

    /// The debug probe, when there are several: VID:PID or VID:PID:SERIAL, as `probe-rs list` shows it
    #[arg(long, value_name = "SELECTOR")]
    probe: Option<String>,

    /// Use this image instead of building one
    #[arg(long, value_name = "FILE")]
    elf: Option<PathBuf>,
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

/// `cargo xtask flash`.
pub fn flash(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let probe_rs = ProbeRs::new(options);
    // Check before the build, which is useless without a probe.
    probe_rs.check()?;
    let elf = elf(workspace, options)?;
    probe_rs.write(&elf)?;
    say!("written, verified and started: {}", elf.display());
    Ok(())
}

/// `cargo xtask run`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let probe_rs = ProbeRs::new(options);
    if !probe_rs.has_probe(options)? {
        return sim::run_image(workspace, options.build.board, options.elf.as_deref());
    }
    let elf = elf(workspace, options)?;
    command::exec(probe_rs.command("run").arg("--verify").arg(elf))
}

/// `cargo xtask attach`.
pub fn attach(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let probe_rs = ProbeRs::new(options);
    probe_rs.check()?;
    let elf = elf(workspace, options)?;
    command::exec(probe_rs.command("attach").arg(elf))
}

/// `cargo xtask gdb`.
pub fn gdb(workspace: &mut Workspace, options: &GdbOptions) -> Result<()> {
    let installed = GDBS.into_iter().find(|gdb| knows_arm(gdb));
    let gdb = options.gdb.as_deref().or(installed).context(
        "no GDB for Arm is installed (on Debian: apt-get install gdb-multiarch); --gdb names another one",
    )?;
    let board = &options.board;
    let probe_rs = ProbeRs::new(board);
    let has_probe = probe_rs.has_probe(board)?;
    let elf = elf(workspace, board)?;
    let address = format!("127.0.0.1:{}", free_port()?);
    let mut server;
    if has_probe {
        probe_rs.write(&elf)?;
        server = probe_rs.command("gdb");
        server.args(["--gdb-connection-string", &address]);
    } else {
        server = Command::new(sim::simulator(workspace)?);
        server.args(["--board", board.build.board.name, "--gdb", &address]);
        server.args(["--http", "127.0.0.1:0", "--elf"]).arg(&elf);
    }
    // GDB handles Ctrl-C by halting the core.
    command::ignore_interrupt()?;
    let _server = Group::start(server)?;
    let mut gdb = Command::new(gdb);
    // GDB tries to connect until the server is ready.
    gdb.arg(elf).args(["-ex", "set tcp connect-timeout 30"]);
    gdb.args(["-ex", &format!("target extended-remote {address}")]);
    command::run(gdb.args(&options.arguments))
}

/// Returns whether a GDB is installed and can debug Arm.
fn knows_arm(gdb: &str) -> bool {
    let try_it = ["-nx", "-batch", "-ex", "set architecture arm"];
    command::read(Command::new(gdb).args(try_it)).is_ok()
}

/// Returns the image that the options name, or builds it.
fn elf(workspace: &mut Workspace, options: &Options) -> Result<PathBuf> {
    let Some(elf) = &options.elf else {
        return Ok(build::image(workspace, options.build.board)?.elf);
    };
    // The chip of `--chip` may have more flash than the board's.
    let size = match options.chip {
        Some(_) => u32::MAX,
        None => Hardware::of(options.build.board).part.flash,
    };
    let flat = image::read(elf).and_then(|bytes| image::flat(&bytes, size));
    flat.map_err(|why| usage(format!("{}: {why:#}", elf.display())))?;
    Ok(elf.clone())
}

/// Returns a TCP port that is free.
pub fn free_port() -> Result<u16> {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).context("no free TCP port")?;
    Ok(listener.local_addr()?.port())
}

/// The program probe-rs with the options for each of its commands.
struct ProbeRs {
    program: PathBuf,
    chip: String,
    probe: Option<String>,
}

impl ProbeRs {
    fn new(options: &Options) -> Self {
        let Memory { name, .. } = Hardware::of(options.build.board).part;
        Self {
            program: "probe-rs".into(),
            chip: options.chip.clone().unwrap_or_else(|| name.to_owned()),
            probe: options.probe.clone(),
        }
    }

    fn command(&self, subcommand: &str) -> Command {
        let mut command = Command::new(&self.program);
        command.args([subcommand, "--chip", &self.chip]);
        if let Some(probe) = &self.probe {
            command.args(["--probe", probe]);
        }
        command
    }

    /// Fails with [`Missing`] when probe-rs is not installed or sees no probe.
    fn check(&self) -> Result<()> {
        let Ok(list) = Command::new(&self.program).arg("list").output() else {
            bail!(Missing(
                "probe-rs is not installed: `cargo install probe-rs-tools --locked`, or see \
                 https://probe.rs/docs/getting-started/installation"
                    .to_owned()
            ));
        };
        let text = [list.stdout.as_slice(), &list.stderr].concat();
        let text = String::from_utf8_lossy(&text).to_lowercase();
        if text.contains("no debug probes were found") {
            bail!(Missing(
                "no debug probe found: connect one (ST-Link, CMSIS-DAP, J-Link) to USB; on Linux it may need the \
                 udev rules of https://probe.rs/docs/getting-started/probe-setup"
                    .to_owned()
            ));
        }
        if !list.status.success() {
            return Err(anyhow!(
                "`probe-rs list` failed: {}",
                command::complaint(&list)
            ));
        }
        Ok(())
    }

    /// Returns whether there is a probe, or the simulator is to be used instead. A probe that the options need is an
    /// error when it is missing.
    fn has_probe(&self, options: &Options) -> Result<bool> {
        match self.check() {
            Ok(()) => Ok(true),
            Err(error)
                if error.is::<Missing>() && options.probe.is_none() && options.chip.is_none() =>
            {
                eprintln!("xtask: using the simulator: {error:#}");
                Ok(false)
            }
            Err(error) => Err(error),
        }
    }

    fn write(&self, elf: &Path) -> Result<()> {
        command::run(self.command("download").arg("--verify").arg(elf))?;
        command::run(&mut self.command("reset"))
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use crate::script::program;

    /// Makes a replacement for probe-rs that records its arguments, a line for each call.
    fn fake(directory: &Path, script: &str) -> ProbeRs {
        let log = directory.join("log");
        let text = format!("echo \"$@\" >> '{}'\n{script}", log.display());
        ProbeRs {
            program: program(directory, "probe-rs", &text),
            chip: "STM32F103CB".to_owned(),
            probe: Some("0483:3748:0667".to_owned()),
        }
    }

    fn calls(directory: &Path) -> Vec<String> {
        let log = fs_err::read_to_string(directory.join("log")).unwrap();
        log.lines().map(str::to_owned).collect()
    }

    #[test]
    fn image_is_written_verified_and_started() {
        let directory = tempfile::tempdir().unwrap();
        let probe_rs = fake(directory.path(), "exit 0");
        probe_rs.check().unwrap();
        probe_rs.write(Path::new("/x/modio")).unwrap();
        assert_eq!(
            calls(directory.path()),
            [
                "list",
                "download --chip STM32F103CB --probe 0483:3748:0667 --verify /x/modio",
                "reset --chip STM32F103CB --probe 0483:3748:0667"
            ]
        );
    }

    #[test]
    fn failed_write_does_not_start_the_board() {
        let directory = tempfile::tempdir().unwrap();
        let probe_rs = fake(directory.path(), "[ $1 = reset ]");
        let error = probe_rs.write(Path::new("/x/modio")).unwrap_err();
        assert!(error.to_string().contains("download"), "{error}");
        assert_eq!(calls(directory.path()).len(), 1);
    }

    #[test]
    fn missing_probe_and_missing_probe_rs_are_reported_with_what_to_do() {
        let directory = tempfile::tempdir().unwrap();
        let mut probe_rs = fake(directory.path(), "echo 'No debug probes were found.'");
        let error = probe_rs.check().unwrap_err();
        assert!(error.is::<Missing>() && error.to_string().contains("connect one"));
        probe_rs.program = "/nowhere/probe-rs".into();
        let error = probe_rs.check().unwrap_err();
        assert!(error.is::<Missing>() && error.to_string().contains("cargo install"));
    }

    #[test]
    fn failing_probe_rs_is_not_mistaken_for_a_missing_probe() {
        let directory = tempfile::tempdir().unwrap();
        let probe_rs = fake(directory.path(), "echo 'error: libusb' >&2; exit 1");
        let error = probe_rs.check().unwrap_err();
        assert!(!error.is::<Missing>() && error.to_string().contains("libusb"));
    }
}
