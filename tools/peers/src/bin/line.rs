//! A serial line between two programs: two pseudo-terminals, each of which receives the bytes written to the other.
//! Prints their paths, one in a line, and runs until its standard input ends.
//!
//! Bytes are transferred immediately at every rate, because a pseudo-terminal has no rate.

use std::ffi::OsStr;
use std::io::{self, Read as _};
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;
use std::sync::Arc;
use std::thread;

use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// A pseudo-terminal.
struct Terminal {
    /// The side that this program copies from and to.
    inner: Arc<OwnedFd>,
    /// The path that a program opens as its serial port.
    path: PathBuf,
    /// Keeps the terminal and its settings while no program has it open.
    _outer: OwnedFd,
}

fn terminal() -> io::Result<Terminal> {
    let inner = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&inner)?;
    unlockpt(&inner)?;
    let name = ptsname(&inner, Vec::new())?;
    let path = PathBuf::from(OsStr::from_bytes(name.as_bytes()));
    let outer = rustix::fs::open(&path, OFlags::RDWR | OFlags::NOCTTY, Mode::empty())?;
    let mut settings = tcgetattr(&outer)?;
    settings.make_raw();
    tcsetattr(&outer, OptionalActions::Now, &settings)?;
    Ok(Terminal {
        inner: Arc::new(inner),
        path,
        _outer: outer,
    })
}

/// Copies bytes from one terminal to the other until one of them fails.
fn copy(from: &OwnedFd, to: &OwnedFd) -> io::Result<()> {
    let mut buffer = [0; 4096];
    loop {
        let length = rustix::io::read(from, &mut buffer)?;
        let mut bytes = &buffer[..length];
        while !bytes.is_empty() {
            let written = rustix::io::write(to, bytes)?;
            bytes = &bytes[written..];
        }
    }
}

fn main() -> io::Result<()> {
    let [one, other] = [terminal()?, terminal()?];
    for (from, to) in [(&one, &other), (&other, &one)] {
        let (from, to) = (Arc::clone(&from.inner), Arc::clone(&to.inner));
        thread::spawn(move || copy(&from, &to));
    }
    println!("{}\n{}", one.path.display(), other.path.display());
    // The standard input ends when the program that started this one ends.
    io::stdin().read_to_end(&mut Vec::new()).map(drop)
}
