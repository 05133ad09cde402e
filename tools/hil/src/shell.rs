//! Other programs that write the image of the board, reset the board and switch its power.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use anyhow::{Context as _, Result, ensure};
use delegate::delegate;
use modbus_line::LineFormat;

use conformance::endpoint::{Abilities, Broken, Endpoint, Piece, Received};

/// How the image is written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Flash {
    /// The debug probe, when there are several.
    pub probe: Option<String>,
    /// The image to write. If `None`, the image is built first.
    pub elf: Option<PathBuf>,
}

/// Updates the unit over the line by `modioctl update`, with these options of modioctl in front. A command that fails has
/// printed the reason.
pub fn update(options: &[String], file: &Path) -> Result<()> {
    let mut command = cargo();
    command.args(["run", "--quiet", "--package", "modioctl", "--"]);
    command.args(options).arg("update").arg(file);
    status(&mut command, "modioctl update")
}

/// Returns the cargo that runs xtask, so that both use the same toolchain.
fn cargo() -> Command {
    Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
}

impl Flash {
    /// Writes the image by `cargo xtask flash`. A command that fails has printed the reason.
    pub fn write(&self) -> Result<()> {
        let mut command = cargo();
        command.args(["xtask", "flash"]);
        if let Some(probe) = &self.probe {
            command.arg("--probe").arg(probe);
        }
        if let Some(elf) = &self.elf {
            command.arg("--elf").arg(elf);
        }
        status(&mut command, "cargo xtask flash")
    }
}

/// Runs a command in a shell, and waits for its end.
pub fn run(script: &str) -> Result<()> {
    let (shell, option) = if cfg!(windows) {
        ("cmd", "/C")
    } else {
        ("sh", "-c")
    };
    status(Command::new(shell).args([option, script]), script)
}

fn status(command: &mut Command, name: &str) -> Result<()> {
    let status = command
        .status()
        .with_context(|| format!("`{name}` cannot be run"))?;
    ensure!(status.success(), "`{name}` failed ({status})");
    Ok(())
}

/// An endpoint with a command that switches the power of the unit.
pub struct Powered {
    line: Box<dyn Endpoint>,
    command: String,
    on: bool,
}

impl Powered {
    /// Returns a line to a unit whose power is on. `command`, followed by `off` or `on`, switches its power.
    pub const fn new(line: Box<dyn Endpoint>, command: String) -> Self {
        Self {
            line,
            command,
            on: true,
        }
    }
}

impl Drop for Powered {
    fn drop(&mut self) {
        if !self.on
            && let Err(broken) = self.set_power(true)
        {
            eprintln!("the unit is still switched off: {broken}");
        }
    }
}

impl Endpoint for Powered {
    fn set_power(&mut self, on: bool) -> Result<(), Broken> {
        // A command that fails may have switched the power off before it failed.
        self.on &= on;
        let script = format!("{} {}", self.command, if on { "on" } else { "off" });
        run(&script).map_err(|error| Broken(format!("{error:#}")))?;
        self.on = on;
        Ok(())
    }

    fn abilities(&self) -> Abilities {
        Abilities {
            power: true,
            ..self.line.abilities()
        }
    }

    delegate! {
        to self.line {
            fn name(&self) -> String;
            fn line(&self) -> LineFormat;
            fn set_line(&mut self, line: LineFormat) -> Result<(), Broken>;
            fn now(&self) -> Duration;
            fn rest(&mut self, time: Duration) -> Result<(), Broken>;
            fn send(&mut self, pieces: &[Piece]) -> Result<Duration, Broken>;
            fn receive(&mut self, patience: Duration, quiet: Duration, enough: usize) -> Result<Vec<Received>, Broken>;
            fn flush(&mut self) -> Result<Vec<Received>, Broken>;
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use crate::fake::Line;

    /// Returns a line whose power is switched by a script that writes its argument to a file.
    fn powered(directory: &std::path::Path, fails: &str) -> Powered {
        let log = directory.join("log");
        let command = format!("f() {{ echo $1 >> '{}'; {fails} }}; f", log.display());
        Powered::new(Box::new(Line::new(&[1])), command)
    }

    fn log(directory: &std::path::Path) -> String {
        std::fs::read_to_string(directory.join("log")).unwrap()
    }

    #[test]
    fn power_is_switched_by_the_command() {
        let directory = tempfile::tempdir().unwrap();
        let mut line = powered(directory.path(), "");
        assert!(line.abilities().power && line.abilities().exact);
        line.set_power(false).unwrap();
        line.set_power(true).unwrap();
        drop(line);
        assert_eq!(log(directory.path()), "off\non\n");
    }

    #[test]
    fn unit_is_switched_on_again_when_the_run_ends_while_it_is_off() {
        let directory = tempfile::tempdir().unwrap();
        let mut line = powered(directory.path(), "");
        line.set_power(false).unwrap();
        drop(line);
        assert_eq!(log(directory.path()), "off\non\n");
    }

    #[test]
    fn command_that_fails_breaks_the_endpoint_and_the_unit_is_switched_on_again() {
        let directory = tempfile::tempdir().unwrap();
        let mut line = powered(directory.path(), "[ $1 = on ];");
        let broken = line.set_power(false).unwrap_err();
        assert!(broken.0.contains("off` failed"), "{broken}");
        drop(line);
        assert_eq!(log(directory.path()), "off\non\n");
    }
}
