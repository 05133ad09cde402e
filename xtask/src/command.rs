//! Running other programs, with failures that name the program and say what is missing.

use std::io::{ErrorKind, Read};
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::{Failure, Result};

/// Runs a program that shows its own output.
///
/// # Errors
///
/// When it is not there or ends with a status other than 0.
pub fn run(command: &mut Command) -> Result<()> {
    let status = command
        .status()
        .map_err(|error| not_started(command, &error))?;
    if status.success() {
        Ok(())
    } else {
        Err(Failure::new(format!(
            "`{}` failed ({status})",
            shown(command)
        )))
    }
}

/// Runs a program for what it prints on its standard output.
///
/// # Errors
///
/// When it is not there or ends with a status other than 0; the first line of its complaint is told.
pub fn read(command: &mut Command) -> Result<String> {
    let output = command
        .output()
        .map_err(|error| not_started(command, &error))?;
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        let why = complaint(&output);
        Err(Failure::new(format!("`{}` failed: {why}", shown(command))))
    }
}

/// Runs a program that may wait for a network that is not there, but no longer than `limit`.
///
/// # Errors
///
/// When it is not there or does not end in time.
pub fn within(limit: Duration, command: &mut Command) -> Result<Output> {
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|error| not_started(command, &error))?;
    let stdout = drain(child.stdout.take());
    let stderr = drain(child.stderr.take());
    let end = Instant::now() + limit;
    let status = loop {
        match child.try_wait() {
            Ok(Some(status)) => break status,
            Ok(None) if Instant::now() < end => thread::sleep(Duration::from_millis(20)),
            Ok(None) => {
                // It is gone already when this fails.
                let _ = child.kill();
                let _ = child.wait();
                let what = format!("`{}` did not end in {} s", shown(command), limit.as_secs());
                return Err(Failure::new(what));
            }
            Err(error) => return Err(not_started(command, &error)),
        }
    };
    Ok(Output {
        status,
        stdout: stdout.join().unwrap_or_default(),
        stderr: stderr.join().unwrap_or_default(),
    })
}

/// Reads a pipe to its end beside the program, which would stop when the pipe is full.
fn drain(pipe: Option<impl Read + Send + 'static>) -> thread::JoinHandle<Vec<u8>> {
    thread::spawn(move || {
        let mut bytes = Vec::new();
        if let Some(mut pipe) = pipe {
            // What came before a broken pipe is all there is to tell.
            let _ = pipe.read_to_end(&mut bytes);
        }
        bytes
    })
}

/// The line with which a program says why it failed: the first that speaks of an error, else the last.
#[must_use]
pub fn complaint(output: &Output) -> String {
    let text = [output.stderr.as_slice(), output.stdout.as_slice()]
        .map(|bytes| String::from_utf8_lossy(bytes).into_owned())
        .join("\n");
    let mut lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let is_error = |line: &&str| line.to_lowercase().contains("error") || line.starts_with("E:");
    lines
        .clone()
        .find(is_error)
        .or_else(|| lines.next_back())
        .map_or_else(|| output.status.to_string(), str::to_owned)
}

/// The command as one would type it.
#[must_use]
pub fn shown(command: &Command) -> String {
    std::iter::once(command.get_program())
        .chain(command.get_args())
        .map(|part| part.to_string_lossy())
        .collect::<Vec<_>>()
        .join(" ")
}

fn not_started(command: &Command, error: &std::io::Error) -> Failure {
    let program = command.get_program().to_string_lossy();
    Failure::new(match error.kind() {
        ErrorKind::NotFound => format!("{program} is not installed"),
        _ => format!("{program} cannot be run: {error}"),
    })
}

/// Puts a program in this process's place, so that signals reach it and its exit status is ours.
///
/// # Errors
///
/// When it cannot be run; otherwise there is no return.
#[cfg(unix)]
pub fn exec(command: &mut Command) -> Result<()> {
    use std::os::unix::process::CommandExt;
    let error = command.exec();
    Err(Failure::new(format!(
        "`{}` cannot be run: {error}",
        shown(command)
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(script: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        command
    }

    #[test]
    fn a_missing_program_is_named() {
        let failure = run(&mut Command::new("no-such-program-here")).unwrap_err();
        assert_eq!(failure.to_string(), "no-such-program-here is not installed");
    }

    #[test]
    fn a_failed_program_is_told_with_its_complaint() {
        let failure = read(&mut shell(
            "echo starting >&2; echo 'error: no network' >&2; exit 3",
        ));
        let text = failure.unwrap_err().to_string();
        assert!(text.ends_with("failed: error: no network"), "{text}");
        assert_eq!(read(&mut shell("echo yes")), Ok("yes\n".to_owned()));
        assert!(
            run(&mut shell("exit 3"))
                .unwrap_err()
                .to_string()
                .contains('3')
        );
    }

    #[test]
    fn a_program_that_hangs_is_stopped() {
        let begin = Instant::now();
        let mut hung = Command::new("sleep");
        let failure = within(Duration::from_millis(100), hung.arg("60")).unwrap_err();
        assert!(failure.to_string().contains("did not end"), "{failure}");
        assert!(begin.elapsed() < Duration::from_secs(30));
    }

    #[test]
    fn a_program_that_prints_more_than_a_pipe_holds_ends() {
        let output = within(
            Duration::from_secs(60),
            &mut shell("head -c 1000000 /dev/zero"),
        );
        assert_eq!(output.unwrap().stdout.len(), 1_000_000);
    }
}
