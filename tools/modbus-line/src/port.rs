//! Opens a serial port.
//!
//! The type of the open port is the caller's: `serial2::SerialPort`, or `serial2_tokio::SerialPort` where the program
//! waits for several things. Both take a [`LineFormat`] as their settings.

#[cfg(unix)]
use std::fs::File;
use std::io;
use std::path::Path;

use serial2::{CharSize, IntoSettings, Settings, StopBits};

use crate::{LineFormat, Parity};

impl IntoSettings for LineFormat {
    fn apply_to_settings(self, settings: &mut Settings) -> io::Result<()> {
        // Also switches flow control off.
        settings.set_raw();
        settings.set_baud_rate(self.baud)?;
        settings.set_char_size(match self.format.data_bits {
            7 => CharSize::Bits7,
            _ => CharSize::Bits8,
        });
        settings.set_parity(match self.format.parity {
            Parity::None => serial2::Parity::None,
            Parity::Even => serial2::Parity::Even,
            Parity::Odd => serial2::Parity::Odd,
        });
        settings.set_stop_bits(match self.format.stop_bits {
            1 => StopBits::One,
            _ => StopBits::Two,
        });
        Ok(())
    }
}

/// An open serial port that no other program can open.
#[derive(Debug)]
pub struct Port<P> {
    /// The port.
    pub inner: P,
    #[cfg(unix)]
    _lock: File,
}

impl<P> Port<P> {
    /// Opens a port with `open`. Two masters on one line would garble each other's answers, so the port is locked.
    ///
    /// # Errors
    ///
    /// Why the port cannot be opened, and what to do.
    pub fn open<'a>(
        path: &'a Path,
        line: LineFormat,
        open: impl FnOnce(&'a Path, LineFormat) -> io::Result<P>,
    ) -> Result<Self, String> {
        let opened = || {
            #[cfg(unix)]
            let lock = lock(path)?;
            let inner = open(path, line)?;
            #[cfg(unix)]
            if !is_pseudo_terminal(path) {
                exclude(&lock);
            }
            Ok(Self {
                inner,
                #[cfg(unix)]
                _lock: lock,
            })
        };
        opened().map_err(|error| refusal(path, line, &error))
    }
}

/// Locks the port against other programs with such a lock. The system removes the lock when the program ends, whatever
/// ends it.
#[cfg(unix)]
fn lock(path: &Path) -> io::Result<File> {
    use rustix::fs::OFlags;
    use std::os::unix::fs::OpenOptionsExt;
    let flags = (OFlags::NOCTTY | OFlags::NONBLOCK).bits();
    let file = File::options()
        .read(true)
        .custom_flags(flags.cast_signed())
        .open(path)?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(std::fs::TryLockError::WouldBlock) => Err(io::ErrorKind::ResourceBusy.into()),
        Err(std::fs::TryLockError::Error(error)) => Err(error),
    }
}

/// Also prevents programs without such a lock from opening the serial port, except those of root. A serial port
/// forgets this at its last close. A pseudo-terminal whose other end stays open never does, so it has only the lock.
#[cfg(unix)]
fn exclude(file: &File) {
    // A port that does not support this is used nevertheless.
    let _ = rustix::termios::ioctl_tiocexcl(file);
}

/// Returns whether a port is a pseudo-terminal, which transfers bytes without parity and stop bits.
#[must_use]
pub fn is_pseudo_terminal(path: &Path) -> bool {
    std::fs::canonicalize(path).is_ok_and(|path| path.starts_with("/dev/pts"))
}

/// Returns why a port does not take these settings or cannot be opened, and what to do.
#[must_use]
pub fn refusal(path: &Path, line: LineFormat, error: &io::Error) -> String {
    let port = path.display();
    let plain = line.format.data_bits == 8 && line.format.parity == Parity::None;
    match error.kind() {
        io::ErrorKind::NotFound => {
            format!("there is no port {port}; this computer has {}", names())
        }
        io::ErrorKind::PermissionDenied if cfg!(windows) => {
            format!("{port} is in use: close the program that has it open")
        }
        io::ErrorKind::PermissionDenied => {
            let group = owning_group(path).unwrap_or_else(|| "dialout".to_owned());
            if group == "root" {
                // No user should join that group.
                format!(
                    "no permission for {port}, which belongs to root: change its owner with `sudo chown $USER {port}`"
                )
            } else {
                format!(
                    "no permission for {port}: add yourself to its group with `sudo usermod -aG {group} $USER` and log in again"
                )
            }
        }
        io::ErrorKind::ResourceBusy => {
            format!("{port} is in use: close the program that has it open")
        }
        _ if !plain && is_pseudo_terminal(path) => {
            format!(
                "{port} does not support {line} ({error}): a pseudo-terminal has no parity, use 8N1 or 8N2"
            )
        }
        io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported => {
            format!(
                "{port} does not support {} bit/s, {} ({error}); try another adapter",
                line.baud, line.format
            )
        }
        _ => format!("{port} cannot be opened: {error}"),
    }
}

/// Returns the names of this computer's serial ports, for people.
fn names() -> String {
    let ports = serialport::available_ports().unwrap_or_default();
    let names: Vec<_> = ports.into_iter().map(|port| port.port_name).collect();
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}

/// Returns the name of the group that may use a port.
#[cfg(unix)]
fn owning_group(path: &Path) -> Option<String> {
    use std::os::unix::fs::MetadataExt;
    let gid = std::fs::metadata(path).ok()?.gid();
    let groups = std::fs::read_to_string("/etc/group").ok()?;
    groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(gid)).then(|| name.to_owned())
    })
}

#[cfg(not(unix))]
fn owning_group(_: &Path) -> Option<String> {
    None
}
