//! Programs that start others: ended together with all they have started, also when this one is.

use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::{Failure, Result, command};

/// How long a program may take to end by itself.
const GRACE: Duration = Duration::from_secs(10);

/// The exit status of a program that Ctrl-C ended, as shells have it.
const INTERRUPTED: i32 = 130;

/// What runs, for the handler of signals.
static RUNNING: Mutex<Vec<u32>> = Mutex::new(Vec::new());

fn running() -> std::sync::MutexGuard<'static, Vec<u32>> {
    // A list of numbers is whole whatever panicked.
    RUNNING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From now on Ctrl-C, or SIGTERM, ends what was [started](Group::start) and then this program.
///
/// # Errors
///
/// When the system has no such handler left.
pub(super) fn end_on_signal() -> Result<()> {
    ctrlc::set_handler(|| {
        // Held to the end, so that nothing is started any more.
        let running = running();
        for id in running.iter() {
            kill(*id);
        }
        eprintln!("xtask: interrupted");
        std::process::exit(INTERRUPTED);
    })
    .map_err(|error| Failure::new(format!("no handler for Ctrl-C: {error}")))
}

/// A program and all it has started. Ended when dropped.
pub(super) struct Group {
    child: Child,
    ended: bool,
}

impl Group {
    /// Starts a program in a group of its own, its standard input a pipe that stays open and empty.
    ///
    /// # Errors
    ///
    /// When it is not there or cannot be run.
    pub(super) fn start(command: &mut Command) -> Result<Self> {
        #[cfg(unix)]
        {
            use std::os::unix::process::CommandExt as _;
            command.process_group(0);
        }
        // Held until it is in the list: a signal finds everything that has been started.
        let mut running = running();
        let child = command.stdin(Stdio::piped()).spawn().map_err(|error| {
            Failure::new(format!(
                "`{}` cannot be run: {error}",
                command::shown(command)
            ))
        })?;
        running.push(child.id());
        Ok(Self {
            child,
            ended: false,
        })
    }

    /// Waits for its end.
    ///
    /// # Errors
    ///
    /// When the system does not tell.
    pub(super) fn wait(mut self) -> Result<ExitStatus> {
        let status = self
            .child
            .wait()
            .map_err(|error| Failure::new(format!("a program was lost: {error}")));
        self.forget();
        status
    }

    /// Whether it has ended by itself.
    pub(super) fn has_ended(&mut self) -> bool {
        !matches!(self.child.try_wait(), Ok(None))
    }

    fn forget(&mut self) {
        self.ended = true;
        running().retain(|id| *id != self.child.id());
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        if self.ended {
            return;
        }
        // Many take the end of their input for an order to end.
        drop(self.child.stdin.take());
        let end = Instant::now() + GRACE;
        while !self.has_ended() && Instant::now() < end {
            thread::sleep(Duration::from_millis(20));
        }
        // Whether or not the first has ended: there may be others.
        kill(self.child.id());
        // It is gone, or will be.
        let _ = self.child.wait();
        self.forget();
    }
}

/// Ends a group at once. One that is gone is all right.
fn kill(id: u32) {
    let mut command = if cfg!(windows) {
        let mut command = Command::new("taskkill");
        command.args(["/F", "/T", "/PID", &id.to_string()]);
        command
    } else {
        let mut command = Command::new("kill");
        command.args(["-KILL", "--", &format!("-{id}")]);
        command
    };
    let _ = command.stdout(Stdio::null()).stderr(Stdio::null()).status();
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    /// Whether a process is there, by its number in a file.
    fn lives(pid: &str) -> bool {
        Command::new("kill")
            .args(["-0", pid])
            .stderr(Stdio::null())
            .status()
            .is_ok_and(|status| status.success())
    }

    #[test]
    fn what_a_program_has_started_ends_with_it() {
        let directory = tempfile::tempdir().unwrap();
        let file = directory.path().join("pid");
        let script = format!(
            "sleep 600 & echo $! > '{}'; read line; exit 0",
            file.display()
        );
        let group = Group::start(Command::new("sh").args(["-c", &script])).unwrap();
        let pid = loop {
            let text = std::fs::read_to_string(&file).unwrap_or_default();
            if text.ends_with('\n') {
                break text.trim().to_owned();
            }
            thread::sleep(Duration::from_millis(10));
        };
        assert!(lives(&pid));
        let begin = Instant::now();
        drop(group);
        assert!(begin.elapsed() < GRACE, "it has seen the end of its input");
        // A killed process stays until its parent, by now init, has looked after it.
        let end = Instant::now() + Duration::from_secs(10);
        while lives(&pid) && !is_zombie(&pid) && Instant::now() < end {
            thread::sleep(Duration::from_millis(10));
        }
        assert!(!lives(&pid) || is_zombie(&pid));
    }

    fn is_zombie(pid: &str) -> bool {
        std::fs::read_to_string(format!("/proc/{pid}/stat")).is_ok_and(|text| text.contains(") Z "))
    }

    #[test]
    fn the_end_of_a_program_is_told() {
        let group = Group::start(Command::new("sh").args(["-c", "exit 7"])).unwrap();
        assert_eq!(group.wait().unwrap().code(), Some(7));
        assert!(Group::start(&mut Command::new("no-such-program-here")).is_err());
    }
}
