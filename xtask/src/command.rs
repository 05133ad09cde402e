//! Runs other programs. Errors name the program and the reason.

use std::io::ErrorKind;
use std::process::{Command, ExitStatus, Output};

use anyhow::{Result, anyhow, ensure};

/// Runs a program that shows its own output.
pub fn run(command: &mut Command) -> Result<()> {
    let status = command.status().map_err(|error| no_start(command, error))?;
    succeeded(command, status)
}

/// Fails when a program that shows its own output has failed.
pub fn succeeded(command: &Command, status: ExitStatus) -> Result<()> {
    ensure!(status.success(), "`{}` failed ({status})", shown(command));
    Ok(())
}

/// Runs a program and returns its output, with any exit status.
pub fn output(command: &mut Command) -> Result<Output> {
    command.output().map_err(|error| no_start(command, error))
}

/// Runs a program and returns its standard output. The error has the line with the reason from its standard error.
pub fn read(command: &mut Command) -> Result<String> {
    let output = output(command)?;
    let (shown, why) = (shown(command), complaint(&output));
    ensure!(output.status.success(), "`{shown}` failed: {why}");
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Returns the line in which a program reports why it failed.
pub fn complaint(output: &Output) -> String {
    let text = [output.stderr.as_slice(), b"\n", &output.stdout].concat();
    reason(&String::from_utf8_lossy(&text)).unwrap_or_else(|| output.status.to_string())
}

/// Returns the first line with an error, else the last line.
pub fn reason(text: &str) -> Option<String> {
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let is_error = |line: &&str| line.to_lowercase().contains("error") || line.starts_with("E:");
    let line = lines.clone().find(is_error).or_else(|| lines.next_back());
    line.map(str::to_owned)
}

/// Returns the command as typed in a shell.
fn shown(command: &Command) -> String {
    let parts = std::iter::once(command.get_program()).chain(command.get_args());
    let parts: Vec<_> = parts.map(|part| part.to_string_lossy()).collect();
    parts.join(" ")
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
    ctrlc::set_handler(|| {})?;
    let status = command.status().map_err(|error| no_start(command, error))?;
    std::process::exit(status.code().unwrap_or(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_and_failed_programs_are_named_with_the_reason() {
        let error = run(&mut Command::new("no-such-program-here")).unwrap_err();
        assert_eq!(error.to_string(), "no-such-program-here is not installed");
        let error = read(Command::new("rustc").arg("no-such-file.rs")).unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("failed: error: ") && text.contains("no-such-file.rs"),
            "{text}"
        );
    }
}
