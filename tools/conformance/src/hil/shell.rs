//! Other programs that write the image of the board, reset the board and switch its power.

use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result, ensure};

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

/// Writes the image by `cargo xtask flash`: through this debug probe, when there are several, and this image; without one
/// the image is built first. A command that fails has printed the reason.
pub fn flash(probe: Option<&str>, elf: Option<&Path>) -> Result<()> {
    let mut command = cargo();
    command.args(["xtask", "flash"]);
    if let Some(probe) = probe {
        command.args(["--probe", probe]);
    }
    if let Some(elf) = elf {
        command.arg("--elf").arg(elf);
    }
    status(&mut command, "cargo xtask flash")
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

/// A command that switches the power of the unit.
#[derive(Debug)]
pub struct Power {
    command: String,
    on: bool,
}

impl Power {
    /// Returns the power of a unit that is on. `command`, followed by `off` or `on`, switches its power.
    pub const fn new(command: String) -> Self {
        Self { command, on: true }
    }

    /// Switches the power.
    pub fn switch(&mut self, on: bool) -> Result<()> {
        // A command that fails may have switched the power off before it failed.
        self.on &= on;
        run(&format!(
            "{} {}",
            self.command,
            if on { "on" } else { "off" }
        ))?;
        self.on = on;
        Ok(())
    }
}

impl Drop for Power {
    fn drop(&mut self) {
        if !self.on
            && let Err(why) = self.switch(true)
        {
            eprintln!("the unit is still switched off: {why:#}");
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    /// The power of a unit that is switched by a script, which writes its argument to a file. The steps switch the power.
    /// Returns what the script has written.
    fn switched(fails: &str, steps: impl FnOnce(&mut Power)) -> String {
        let directory = tempfile::tempdir().unwrap();
        let log = directory.path().join("log");
        let script = format!("f() {{ echo $1 >> '{}'; {fails} }}; f", log.display());
        let mut power = Power::new(script);
        steps(&mut power);
        drop(power);
        std::fs::read_to_string(log).unwrap()
    }

    #[test]
    fn power_is_switched_by_the_command() {
        let log = switched("", |power| {
            power.switch(false).unwrap();
            power.switch(true).unwrap();
        });
        assert_eq!(log, "off\non\n");
    }

    #[test]
    fn unit_is_switched_on_again_when_the_run_ends_while_it_is_off() {
        let log = switched("", |power| power.switch(false).unwrap());
        assert_eq!(log, "off\non\n");
    }

    #[test]
    fn command_that_fails_is_an_error_and_the_unit_is_switched_on_again() {
        let log = switched("[ $1 = on ];", |power| {
            let error = power.switch(false).unwrap_err().to_string();
            assert!(error.contains("off` failed"), "{error}");
        });
        assert_eq!(log, "off\non\n");
    }
}
