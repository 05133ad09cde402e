//! The RS-485 line on a pseudo-terminal, which a Modbus master opens like a serial port.
//!
//! Its settings are raw. Bytes cross the line at the rate of the unit, unless the client of the line has a fixed rate:
//! then the rate is the one that the master sets. A pseudo-terminal stores neither parity nor length of characters, so
//! the format never comes from there. As on a serial port, bytes that arrive while no program has it open are lost: a
//! master never finds replies to requests that it did not send.

use std::fs;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::thread;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use super::Event;

/// How often the simulator checks whether somebody has opened the terminal.
const LOOK: Duration = Duration::from_millis(5);

/// The terminal, and the link to it.
pub struct Pty {
    master: Arc<OwnedFd>,
    path: PathBuf,
    link: Option<PathBuf>,
    /// The rate that the master has set, where that counts.
    rate: Option<u32>,
}

impl Pty {
    /// Makes a terminal, and `link` a symlink to it. What is written to it comes as events.
    ///
    /// # Errors
    ///
    /// When the system has none, or there is something else at `link`: in one line.
    pub fn open(link: Option<&Path>, events: Sender<Event>) -> Result<Self, String> {
        let (master, path) =
            raw_terminal().map_err(|error| format!("cannot make a pseudo-terminal: {error}"))?;
        let master = Arc::new(master);
        if let Some(link) = link {
            symlink(&path, link).map_err(|why| {
                format!("cannot make {} a link to the pty: {why}", link.display())
            })?;
        }
        let listening = Arc::clone(&master);
        thread::spawn(move || listen(&listening, &events));
        Ok(Self {
            master,
            path,
            link: link.map(Path::to_owned),
            rate: None,
        })
    }

    /// The terminal's own name: `/dev/pts/N`.
    #[allow(clippy::unnecessary_wraps, reason = "some systems have no terminal")]
    pub fn path(&self) -> Option<&Path> {
        Some(&self.path)
    }

    /// From now on the rate that a master sets counts; until one does, it is `baud`.
    ///
    /// # Errors
    ///
    /// When the terminal cannot have this rate, in one line.
    pub fn keep_own_rate(&mut self, baud: u32) -> Result<(), String> {
        let set = || {
            let mut settings = tcgetattr(&self.master)?;
            settings.set_speed(baud)?;
            tcsetattr(&self.master, OptionalActions::Now, &settings)
        };
        set().map_err(|error| format!("the pseudo-terminal cannot have {baud} baud: {error}"))?;
        self.rate = Some(baud);
        Ok(())
    }

    /// The rate that the master has set since the last call, where that counts and it is another one.
    pub fn take_rate(&mut self) -> Option<u32> {
        let before = self.rate?;
        // Rates that no UART has, such as 0, which hangs up, are none.
        let now = tcgetattr(&self.master).ok()?.output_speed();
        let changed = now != before && (300..=4_000_000).contains(&now);
        self.rate = Some(if changed { now } else { before });
        changed.then_some(now)
    }

    /// Offers these bytes to the program that has the terminal open; never waits. Bytes that do not fit are lost.
    pub fn write(&self, bytes: &[u8]) {
        let state = state(&self.master, PollFlags::OUT, Some(Duration::ZERO));
        if !state.contains(PollFlags::HUP) {
            // Does not wait, for the terminal is non-blocking.
            let _ = rustix::io::write(&*self.master, bytes);
        }
    }
}

impl Drop for Pty {
    fn drop(&mut self) {
        if let Some(link) = &self.link {
            // Another simulator may have put its own there since.
            if fs::read_link(link).is_ok_and(|to| to == self.path) {
                let _ = fs::remove_file(link);
            }
        }
    }
}

/// A new terminal: our side of it, and the name of the other.
fn raw_terminal() -> rustix::io::Result<(OwnedFd, PathBuf)> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    let name = ptsname(&master, Vec::new())?;
    let path = PathBuf::from(std::ffi::OsStr::from_bytes(name.as_bytes()));
    // The settings last as long as our side is open. The other side is opened once and closed here: only after that
    // does poll show whether a program has opened it.
    let other = rustix::fs::open(&path, OFlags::RDWR | OFlags::NOCTTY, Mode::empty())?;
    let mut settings = tcgetattr(&other)?;
    settings.make_raw();
    tcsetattr(&other, OptionalActions::Now, &settings)?;
    rustix::fs::fcntl_setfl(&master, OFlags::NONBLOCK)?;
    Ok((master, path))
}

/// Makes a link where nothing is, or where a simulator that was killed has left one.
fn symlink(path: &Path, link: &Path) -> Result<(), String> {
    if let Ok(old) = fs::read_link(link) {
        if !old.starts_with("/dev/pts") && old.exists() {
            return Err(format!("it is a link to {} already", old.display()));
        }
        fs::remove_file(link).map_err(|error| error.to_string())?;
    }
    std::os::unix::fs::symlink(path, link).map_err(|error| error.to_string())
}

/// What of `wanted` the terminal is ready for now or within `wait`; HUP while nobody has it open.
fn state(terminal: &OwnedFd, wanted: PollFlags, wait: Option<Duration>) -> PollFlags {
    let mut polled = [PollFd::new(terminal, wanted)];
    let wait = wait.and_then(|wait| Timespec::try_from(wait).ok());
    match poll(&mut polled, wait.as_ref()) {
        Ok(_) => polled[0].revents(),
        // Interrupted by a signal: nothing is known.
        Err(_) => PollFlags::empty(),
    }
}

fn listen(terminal: &OwnedFd, events: &Sender<Event>) {
    let mut buffer = [0; 4096];
    loop {
        let state = state(terminal, PollFlags::IN, None);
        if state.contains(PollFlags::IN) {
            match rustix::io::read(terminal, &mut buffer) {
                Ok(length)
                    if events
                        .send(Event::Bytes(buffer[..length].to_vec()))
                        .is_err() =>
                {
                    return;
                }
                // Errors are those of a terminal just closed: it may be opened again.
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
