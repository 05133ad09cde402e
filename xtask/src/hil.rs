//! `cargo xtask hil`: the image on a real board: written and started if asked, then the conformance suite,
//! the timing at each rate and the wires of a fixture, all by `modio-hil` of package conformance.
//!
//! That program takes this one's place for its part, so that Ctrl-C and SIGTERM reach it, it puts the
//! board back, and its exit status is ours.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::workspace::Workspace;
use crate::{Failure, Result, command, flash};

/// What to do with which board.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// The serial port that the board's line is on
    #[arg(long, value_name = "PORT")]
    port: PathBuf,

    /// Write the image into the board first
    #[arg(long)]
    flash: bool,

    #[command(flatten)]
    image: flash::Options,

    /// Run this in a shell before the tests, to reset the board or to switch it on
    #[arg(long, value_name = "CMD")]
    reset_cmd: Option<String>,

    /// The unit's address [default: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..))]
    unit: Option<u8>,

    /// The line's rate in bit/s [default: 9600]
    #[arg(long, value_name = "RATE")]
    baud: Option<u32>,

    /// The line's format: 8N2, 8E1, 8O1 or 8N1 [default: 8N2]
    #[arg(long, value_name = "FORMAT")]
    format: Option<String>,

    /// Run the cases too that write the unit's configuration; they put it back
    #[arg(long)]
    allow_config: bool,

    /// Run only cases of the suite whose name contains this; may be repeated
    #[arg(long, value_name = "PATTERN")]
    only: Vec<String>,

    /// Leave the conformance suite out
    #[arg(long, conflicts_with = "only")]
    no_suite: bool,

    /// Requests at each rate for the timing; 0 leaves it out [default: 2000]
    #[arg(long, value_name = "N")]
    requests: Option<u32>,

    /// Measure at these rates, such as 9600,115200, or `all`; the unit's configuration is saved on the
    /// way and put back [default: the present one]
    #[arg(long, value_name = "LIST")]
    rates: Option<String>,

    /// Fail when more than one turnaround of a hundred is above this
    #[arg(long, value_name = "MS")]
    limit: Option<u64>,

    /// Try the wires from outputs to inputs that this file describes, in TOML
    #[arg(long, value_name = "FILE")]
    fixture: Option<PathBuf>,

    /// What stays silent for so long, in ms, is silent [default: 250]
    #[arg(long, value_name = "MS")]
    patience: Option<u64>,

    /// Write the results as JUnit XML
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,

    /// Write the results and the times as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// `cargo xtask hil`.
///
/// # Errors
///
/// When an option, the fixture or the port is wrong, the image cannot be written, or the board cannot be
/// reset. What the tests find, their program tells by its own exit status.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    if !options.flash && options.image.is_told() {
        return Err(Failure::asked(
            "--probe and --elf say what to write and how: add --flash",
        ));
    }
    let tester = tester(workspace)?;
    let write = || flash::run(workspace, &options.image);
    let mut command = options.prepare(&tester, write)?;
    become_tester(&mut command)
}

/// Builds the program that tests, and tells where it is.
fn tester(workspace: &Workspace) -> Result<PathBuf> {
    let mut cargo = workspace.cargo("build");
    cargo.args(["--quiet", "--package", "conformance", "--bin", "modio-hil"]);
    command::run(&mut cargo)?;
    let name = format!("modio-hil{}", std::env::consts::EXE_SUFFIX);
    Ok(workspace.target().join("debug").join(name))
}

impl Options {
    /// Gets the board ready; gives the command that tests it.
    fn prepare(&self, tester: &Path, write: impl FnOnce() -> Result<()>) -> Result<Command> {
        let mut test = Command::new(tester);
        test.args(self.arguments());
        if self.flash || self.reset_cmd.is_some() {
            // A mistake is told before anything is done to the board.
            let mut check = Command::new(tester);
            check.args(self.arguments()).arg("--check");
            checked(&mut check)?;
        }
        if self.flash {
            write()?;
        }
        if let Some(reset) = &self.reset_cmd {
            command::run(&mut shell(reset))?;
        }
        Ok(test)
    }

    fn arguments(&self) -> Vec<OsString> {
        let text = |value: &Option<String>| value.clone().map(OsString::from);
        let path = |value: &Option<PathBuf>| value.clone().map(OsString::from);
        let number = |value: Option<u64>| value.map(|number| number.to_string().into());
        let mut arguments = vec!["--port".into(), self.port.clone().into()];
        for (option, value) in [
            ("--unit", number(self.unit.map(u64::from))),
            ("--baud", number(self.baud.map(u64::from))),
            ("--format", text(&self.format)),
            ("--requests", number(self.requests.map(u64::from))),
            ("--rates", text(&self.rates)),
            ("--limit", number(self.limit)),
            ("--fixture", path(&self.fixture)),
            ("--patience", number(self.patience)),
            ("--junit", path(&self.junit)),
            ("--json", path(&self.json)),
        ] {
            if let Some(value) = value {
                arguments.extend([option.into(), value]);
            }
        }
        for pattern in &self.only {
            arguments.extend(["--only".into(), pattern.into()]);
        }
        for (flag, given) in [
            ("--allow-config", self.allow_config),
            ("--no-suite", self.no_suite),
        ] {
            if given {
                arguments.push(flag.into());
            }
        }
        arguments
    }
}

/// Runs the tester's check, which tells by itself what is wrong, in a line.
fn checked(check: &mut Command) -> Result<()> {
    let output = check
        .output()
        .map_err(|error| Failure::new(format!("modio-hil cannot be run: {error}")))?;
    if output.status.success() {
        return Ok(());
    }
    let complaint = command::complaint(&output);
    Err(Failure::asked(
        complaint.trim_start_matches("modio-hil: ").to_owned(),
    ))
}

fn shell(script: &str) -> Command {
    let (program, option) = if cfg!(windows) {
        ("cmd", "/C")
    } else {
        ("sh", "-c")
    };
    let mut command = Command::new(program);
    command.args([option, script]);
    command
}

#[cfg(unix)]
use command::exec as become_tester;

/// Without exec: Ctrl-C goes to the tester as well, which is waited for, and its status passed on.
#[cfg(not(unix))]
fn become_tester(tester: &mut Command) -> Result<()> {
    ctrlc::set_handler(|| {})
        .map_err(|error| Failure::new(format!("no handler for Ctrl-C: {error}")))?;
    let status = tester
        .status()
        .map_err(|error| Failure::new(format!("modio-hil cannot be run: {error}")))?;
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    match code.unwrap_or(1) {
        0 => Ok(()),
        code => {
            let mut failure = Failure::new("the board has not passed");
            failure.code = code;
            Err(failure)
        }
    }
}

#[cfg(all(test, unix))]
mod tests;
