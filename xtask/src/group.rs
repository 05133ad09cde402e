//! Programs that start others: ended together with everything that they have started, even when xtask is interrupted.

use std::process::{Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, ensure};
use process_wrap::std::{ChildWrapper, CommandWrap};

use crate::command;

/// Time for a program to end after its standard input has been closed.
const GRACE: Duration = Duration::from_secs(10);

/// Interval at which the end of a program and an interruption are checked.
const POLL: Duration = Duration::from_millis(20);

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Makes Ctrl-C and SIGTERM end the [groups](Group) and make their methods fail.
pub fn end_on_signal() -> Result<()> {
    let handler = || INTERRUPTED.store(true, Ordering::Relaxed);
    ctrlc::set_handler(handler).context("no handler for Ctrl-C")
}

/// A program and everything that it has started. Ended when dropped.
pub struct Group {
    child: Box<dyn ChildWrapper>,
}

impl Group {
    /// Starts a program in a new group. Its standard input is a pipe that stays open and empty.
    pub fn start(mut command: Command) -> Result<Self> {
        not_interrupted()?;
        command.stdin(Stdio::piped());
        let mut wrapped = CommandWrap::from(command);
        #[cfg(unix)]
        wrapped.wrap(process_wrap::std::ProcessGroup::leader());
        #[cfg(windows)]
        wrapped.wrap(process_wrap::std::JobObject);
        let child = wrapped.spawn();
        let child = child.map_err(|error| command::no_start(wrapped.command(), error))?;
        Ok(Self { child })
    }

    /// Waits for the end of the program.
    pub fn wait(mut self) -> Result<ExitStatus> {
        loop {
            if let Some(status) = self.child.try_wait()? {
                return Ok(status);
            }
            not_interrupted()?;
            thread::sleep(POLL);
        }
    }

    /// Returns whether the program has ended.
    pub fn has_ended(&mut self) -> Result<bool> {
        not_interrupted()?;
        Ok(self.child.try_wait()?.is_some())
    }
}

fn not_interrupted() -> Result<()> {
    ensure!(!INTERRUPTED.load(Ordering::Relaxed), "interrupted");
    Ok(())
}

impl Drop for Group {
    fn drop(&mut self) {
        // Many programs end when their input ends.
        drop(self.child.stdin().take());
        let end = Instant::now() + GRACE;
        while self.has_ended().is_ok_and(|ended| !ended) && Instant::now() < end {
            thread::sleep(POLL);
        }
        // Programs that the first one has started may still run when it has ended. An error means that there are none.
        let _ = self.child.start_kill();
        let _ = self.child.wait();
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    /// Returns whether a process runs. A process that has ended is a zombie until init has read its exit status.
    fn runs(pid: &str) -> bool {
        let state = fs_err::read_to_string(format!("/proc/{pid}/stat"));
        state.is_ok_and(|text| !text.contains(") Z "))
    }

    #[test]
    fn programs_that_a_program_has_started_end_with_it() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("pid");
        let script = format!(
            "sleep 600 & echo $! > '{}'; read line; exit 0",
            file.display()
        );
        let mut shell = Command::new("sh");
        shell.args(["-c", &script]);
        let group = Group::start(shell).unwrap();
        let pid = loop {
            let text = fs_err::read_to_string(&file).unwrap_or_default();
            if text.ends_with('\n') {
                break text.trim().to_owned();
            }
            thread::sleep(POLL);
        };
        assert!(runs(&pid));
        let begin = Instant::now();
        drop(group);
        assert!(
            begin.elapsed() < GRACE,
            "the program does not end with its input"
        );
        while runs(&pid) && begin.elapsed() < GRACE {
            thread::sleep(POLL);
        }
        assert!(!runs(&pid));
    }

    #[test]
    fn exit_status_is_returned_and_missing_program_is_an_error() {
        let mut shell = Command::new("sh");
        shell.args(["-c", "exit 7"]);
        assert_eq!(Group::start(shell).unwrap().wait().unwrap().code(), Some(7));
        assert!(Group::start(Command::new("no-such-program-here")).is_err());
    }
}
