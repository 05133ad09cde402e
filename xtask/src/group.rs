//! Programs that run in parallel to xtask: ended together with everything that they have started, even when xtask is
//! interrupted.

use std::io::{BufRead as _, BufReader, Lines};
use std::process::{ChildStdout, Command, ExitStatus, Stdio};
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, ensure};
use process_wrap::std::{ChildWrapper, CommandWrap};

use crate::command;

/// Interval at which the end of a program and an interruption are checked.
const POLL: Duration = Duration::from_millis(20);

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// A program and everything that it has started. Ended when dropped.
///
/// After the first start of a group, Ctrl-C and SIGTERM no longer end xtask. They make the methods fail instead.
pub struct Group {
    child: Box<dyn ChildWrapper>,
    lines: Option<Lines<BufReader<ChildStdout>>>,
}

impl Group {
    /// Starts a program in a new group. Its standard input is a pipe that stays open and empty.
    pub fn start(mut command: Command) -> Result<Self> {
        static HANDLER: Once = Once::new();
        HANDLER.call_once(|| {
            // An error means that there is another handler, which keeps xtask running as well.
            let _ = ctrlc::set_handler(|| INTERRUPTED.store(true, Ordering::Relaxed));
        });
        not_interrupted()?;
        command.stdin(Stdio::piped());
        let mut wrapped = CommandWrap::from(command);
        #[cfg(unix)]
        wrapped.wrap(process_wrap::std::ProcessGroup::leader());
        #[cfg(windows)]
        wrapped.wrap(process_wrap::std::JobObject);
        let child = wrapped.spawn();
        let mut child = child.map_err(|error| command::no_start(wrapped.command(), error))?;
        let lines = child.stdout().take();
        let lines = lines.map(|stdout| BufReader::new(stdout).lines());
        Ok(Self { child, lines })
    }

    /// Returns the next line that the program prints, if its standard output is a pipe.
    pub fn line(&mut self) -> Result<String> {
        let line = self.lines.as_mut().and_then(Iterator::next);
        Ok(line.context("the program has ended at its start")??)
    }

    /// Returns the exit status, if the program has ended.
    pub fn ended(&mut self) -> Result<Option<ExitStatus>> {
        not_interrupted()?;
        Ok(self.child.try_wait()?)
    }

    /// Waits for the end of the program, or returns `None` if it still runs after the limit.
    pub fn wait(&mut self, limit: Duration) -> Result<Option<ExitStatus>> {
        let begin = Instant::now();
        loop {
            let status = self.ended()?;
            if status.is_some() || begin.elapsed() >= limit {
                return Ok(status);
            }
            thread::sleep(POLL);
        }
    }
}

/// Fails after Ctrl-C or SIGTERM.
pub fn not_interrupted() -> Result<()> {
    ensure!(!INTERRUPTED.load(Ordering::Relaxed), "interrupted");
    Ok(())
}

impl Drop for Group {
    fn drop(&mut self) {
        // Programs that the first one has started may still run when it has ended. An error means that there are none.
        let _ = self.child.start_kill();
        let _ = self.child.wait();
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn programs_that_a_program_has_started_end_with_it() {
        let mut shell = Command::new("sh");
        shell.args(["-c", "sleep 600 & echo $!; wait"]);
        shell.stdout(Stdio::piped());
        let mut group = Group::start(shell).unwrap();
        let pid = group.line().unwrap();
        // A process that has ended is a zombie until init has read its exit status.
        let runs = || {
            let state = fs_err::read_to_string(format!("/proc/{pid}/stat"));
            state.is_ok_and(|text| !text.contains(") Z "))
        };
        assert!(runs() && group.wait(POLL).unwrap().is_none());
        drop(group);
        let begin = Instant::now();
        while runs() && begin.elapsed() < Duration::from_secs(10) {
            thread::sleep(POLL);
        }
        assert!(!runs());
    }
}
