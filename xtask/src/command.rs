//! Runs other programs. Errors name the program and the reason.

use std::ffi::{OsStr, OsString};
use std::io::ErrorKind;
use std::process::{Command, Output};

use anyhow::{Context as _, Result, anyhow, bail};

/// Runs a program that shows its own output.
pub fn run(command: &mut Command) -> Result<()> {
    let status = command.status().map_err(|error| no_start(command, error))?;
    if !status.success() {
        bail!("`{}` failed ({status})", shown(command));
    }
    Ok(())
}

/// Runs a program and returns its output, with any exit status.
pub fn output(command: &mut Command) -> Result<Output> {
    command.output().map_err(|error| no_start(command, error))
}

/// Runs a program and returns its standard output. The error has the line with the reason from its standard error.
pub fn read(command: &mut Command) -> Result<String> {
    let output = output(command)?;
    if !output.status.success() {
        bail!("`{}` failed: {}", shown(command), complaint(&output));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Returns the line in which a program reports why it failed: the first with an error, else the last.
pub fn complaint(output: &Output) -> String {
    let text = [output.stderr.as_slice(), b"\n", &output.stdout].concat();
    let text = String::from_utf8_lossy(&text);
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let is_error = |line: &&str| line.to_lowercase().contains("error") || line.starts_with("E:");
    lines
        .clone()
        .find(is_error)
        .or_else(|| lines.next_back())
        .map_or_else(|| output.status.to_string(), str::to_owned)
}

/// Returns the command as typed in a shell.
pub fn shown(command: &Command) -> String {
    let parts = std::iter::once(command.get_program()).chain(command.get_args());
    let parts: Vec<_> = parts.map(|part| part.to_string_lossy()).collect();
    parts.join(" ")
}

/// Returns an argument that consists of an option and a path.
pub fn joined(option: &str, path: impl AsRef<OsStr>) -> OsString {
    let mut argument = OsString::from(option);
    argument.push(path);
    argument
}

/// Returns the error of a program that does not start.
pub fn no_start(command: &Command, error: std::io::Error) -> anyhow::Error {
    let program = command.get_program().to_string_lossy();
    match error.kind() {
        ErrorKind::NotFound => anyhow!("{program} is not installed"),
        _ => anyhow!("{program} cannot be run: {error}"),
    }
}

/// Replaces this process with a program, which then receives the signals and sets the exit status.
#[cfg(unix)]
pub fn exec(command: &mut Command) -> Result<()> {
    use std::os::unix::process::CommandExt as _;
    let error = command.exec();
    Err(no_start(command, error))
}

/// Runs a program, which receives Ctrl-C too, and ends with its exit status.
#[cfg(not(unix))]
pub fn exec(command: &mut Command) -> Result<()> {
    ignore_interrupt()?;
    let status = command.status().map_err(|error| no_start(command, error))?;
    std::process::exit(status.code().unwrap_or(1))
}

/// Makes this process ignore Ctrl-C, which then only the started programs handle.
pub fn ignore_interrupt() -> Result<()> {
    ctrlc::set_handler(|| {}).context("no handler for Ctrl-C")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_and_failed_programs_are_named_with_the_reason() {
        let error = run(&mut Command::new("no-such-program-here")).unwrap_err();
        assert_eq!(error.to_string(), "no-such-program-here is not installed");
        let script = "echo starting >&2; echo 'error: no network' >&2; exit 3";
        let error = read(Command::new("sh").args(["-c", script])).unwrap_err();
        assert!(
            error.to_string().ends_with("failed: error: no network"),
            "{error}"
        );
    }
}
