//! The RS-485 line, the gateway radio or the RS-232 socket on a pseudo-terminal, which a Modbus master opens like a serial port.
//!
//! The terminal is raw. Bytes are sent on the line at the unit's rate, or with `--fixed-line` at the rate that the
//! master sets. A pseudo-terminal stores neither the parity nor the length of characters, so the master cannot set the
//! format. As on a serial port, bytes that arrive while no program has the terminal open are lost: a master never
//! receives replies to requests that it did not send.

use std::fs;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::thread;
use std::time::Duration;

use modbus_line::RATES;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use super::{Event, Hold, pass_on};

/// Interval at which the simulator checks whether a program has opened the terminal.
const LOOK: Duration = Duration::from_millis(5);

/// The terminal, and the symlink to it.
pub struct Pty {
    master: Arc<OwnedFd>,
    path: PathBuf,
    link: Option<PathBuf>,
    /// The rate of the terminal in bit/s; `None` while the master's rate is ignored.
    rate: Option<u32>,
}

impl Pty {
    /// Makes a terminal, and `link` a symlink to it. `event` makes an event of the bytes that a master writes.
    ///
    /// # Errors
    ///
    /// In one line: the system cannot make a terminal, or another file exists at `link`.
    pub fn open(
        link: Option<&Path>,
        events: Sender<Event>,
        event: fn(Vec<u8>, Hold) -> Event,
    ) -> Result<Self, String> {
        let (master, path) =
            raw_terminal().map_err(|error| format!("cannot make a pseudo-terminal: {error}"))?;
        let master = Arc::new(master);
        if let Some(link) = link {
            symlink(&path, link).map_err(|why| {
                format!(
                    "cannot make {} a symlink to the pseudo-terminal: {why}",
                    link.display()
                )
            })?;
        }
        let listening = Arc::clone(&master);
        thread::spawn(move || listen(&listening, &events, event));
        Ok(Self {
            master,
            path,
            link: link.map(Path::to_owned),
            rate: None,
        })
    }

    /// Returns the terminal's own name: `/dev/pts/N`.
    #[allow(clippy::unnecessary_wraps, reason = "some systems have no terminal")]
    pub fn path(&self) -> Option<&Path> {
        Some(&self.path)
    }

    /// Lets [`take_rate`](Self::take_rate) return from now on the rates that a master sets. The rate until then is
    /// `baud`, in bit/s.
    ///
    /// # Errors
    ///
    /// In one line, why the terminal cannot have this rate.
    pub fn keep_own_rate(&mut self, baud: u32) -> Result<(), String> {
        let set = || {
            let mut settings = tcgetattr(&self.master)?;
            settings.set_speed(baud)?;
            tcsetattr(&self.master, OptionalActions::Now, &settings)
        };
        set().map_err(|error| format!("the pseudo-terminal cannot have {baud} bit/s: {error}"))?;
        self.rate = Some(baud);
        Ok(())
    }

    /// Returns the rate in bit/s if the master has changed it since the last call. Always `None` before
    /// [`keep_own_rate`](Self::keep_own_rate).
    pub fn take_rate(&mut self) -> Option<u32> {
        let before = self.rate?;
        // Ignore rates that no UART has. A rate of 0 means that the master hangs up.
        let now = tcgetattr(&self.master).ok()?.output_speed();
        let changed = now != before && RATES.contains(&now.into());
        self.rate = Some(if changed { now } else { before });
        changed.then_some(now)
    }

    /// Offers these bytes to the program that has the terminal open; never waits. Bytes that do not fit are lost.
    pub fn write(&self, bytes: &[u8]) {
        let state = state(&self.master, PollFlags::OUT, Some(Duration::ZERO));
        if !state.contains(PollFlags::HUP) {
            // Does not wait, because the terminal is non-blocking.
            let _ = rustix::io::write(&*self.master, bytes);
        }
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        if let Some(link) = &self.link {
            // Keep the symlink if another simulator has replaced it by its own.
            if fs::read_link(link).is_ok_and(|to| to == self.path) {
                let _ = fs::remove_file(link);
            }
        }
    }
}

/// Makes a raw terminal. Returns the simulator's side of it, and the path of the master's side.
fn raw_terminal() -> rustix::io::Result<(OwnedFd, PathBuf)> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let name = ptsname(&master, Vec::new())?;
    let path = PathBuf::from(std::ffi::OsStr::from_bytes(name.as_bytes()));
    // The settings last as long as the simulator's side is open. The other side is opened once and closed here: only
    // after that does `poll` show whether a program has opened it.
    let other = rustix::fs::open(&path, OFlags::RDWR | OFlags::NOCTTY, Mode::empty())?;
    let mut settings = tcgetattr(&other)?;
    settings.make_raw();
    tcsetattr(&other, OptionalActions::Now, &settings)?;
    rustix::fs::fcntl_setfl(&master, OFlags::NONBLOCK)?;
    Ok((master, path))
}

/// Makes a symlink at `link`. Replaces a symlink that leads to a pseudo-terminal or nowhere, but no other file.
fn symlink(path: &Path, link: &Path) -> Result<(), String> {
    if let Ok(old) = fs::read_link(link) {
        if !old.starts_with("/dev/pts") && old.exists() {
            return Err(format!("it is already a symlink to {}", old.display()));
        }
        fs::remove_file(link).map_err(|error| error.to_string())?;
    }
    std::os::unix::fs::symlink(path, link).map_err(|error| error.to_string())
}

/// Waits until the terminal is ready for one of `wanted`, or until `wait` is over. Returns what it is ready
/// for, and HUP while no program has it open.
fn state(terminal: &OwnedFd, wanted: PollFlags, wait: Option<Duration>) -> PollFlags {
    let mut polled = [PollFd::new(terminal, wanted)];
    let wait = wait.and_then(|wait| Timespec::try_from(wait).ok());
    match poll(&mut polled, wait.as_ref()) {
        Ok(_) => polled[0].revents(),
        // Interrupted by a signal: the state is unknown.
        Err(_) => PollFlags::empty(),
    }
}

fn listen(terminal: &OwnedFd, events: &Sender<Event>, event: fn(Vec<u8>, Hold) -> Event) {
    let mut buffer = [0; 4096];
    loop {
        let state = state(terminal, PollFlags::IN, None);
        if state.contains(PollFlags::IN) {
            match rustix::io::read(terminal, &mut buffer) {
                Ok(length) if !pass_on(&buffer[..length], event, events) => return,
                // Reading fails when the master has just closed the terminal. It may open the terminal again.
                Ok(_) | Err(_) => {}
            }
        } else if !state.is_empty() {
            thread::sleep(LOOK);
        }
    }
}

#[cfg(test)]
#[path = "pty_tests.rs"]
mod tests;
