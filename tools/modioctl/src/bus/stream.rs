//! The connection for the bytes: a serial port, or a TCP connection.

use std::io;
use std::time::Duration;

use modbus_line::{Format, Parity};
use serial2_tokio::{self as serial, CharSize, SerialPort, Settings, StopBits};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::timeout;

use super::endpoint::{Endpoint, Place};
use crate::failure::Failure;

/// Time limit for opening a connection.
const CONNECTING: Duration = Duration::from_secs(5);

/// An open serial port or connection.
#[derive(Debug)]
pub enum Stream {
    /// A serial port or a pseudo-terminal.
    Serial(Serial),
    /// A connection.
    Tcp(TcpStream),
}

/// An open serial port.
#[derive(Debug)]
pub struct Serial {
    port: SerialPort,
    #[cfg(unix)]
    _lock: std::fs::File,
}

impl Stream {
    /// Opens the connection.
    ///
    /// # Errors
    ///
    /// When it cannot be opened; the error says why and what to do.
    pub async fn open(endpoint: &Endpoint) -> Result<Self, Failure> {
        match &endpoint.place {
            Place::Serial(path) => {
                let settings = |settings| with(settings, path, endpoint);
                let not_opened = |error| not_opened(path, endpoint, &error);
                #[cfg(unix)]
                let lock = lock(path).map_err(not_opened)?;
                let port = SerialPort::open(path, settings).map_err(not_opened)?;
                #[cfg(unix)]
                if !is_pseudo_terminal(path) {
                    exclude(&lock);
                }
                // Bytes received before are not part of any answer.
                let _ = port.discard_buffers();
                Ok(Self::Serial(Serial {
                    port,
                    #[cfg(unix)]
                    _lock: lock,
                }))
            }
            Place::Tcp(address) | Place::ModbusTcp(address) => {
                let connected = timeout(CONNECTING, TcpStream::connect(address)).await;
                let stream = connected
                    .unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()))
                    .map_err(|error| {
                        Failure::Port(format!(
                            "no connection to {address} ({error}): check the address, and whether the gateway or simulator runs"
                        ))
                    })?;
                let _ = stream.set_nodelay(true);
                Ok(Self::Tcp(stream))
            }
        }
    }

    /// Changes the settings of the line. Over TCP they are those of the gateway.
    ///
    /// # Errors
    ///
    /// When the port does not support them.
    pub fn change(&mut self, endpoint: &Endpoint) -> Result<(), Failure> {
        let (Self::Serial(serial), Place::Serial(path)) = (self, &endpoint.place) else {
            return Ok(());
        };
        let port = &mut serial.port;
        let changed = port
            .get_configuration()
            .and_then(|settings| with(settings, path, endpoint))
            .and_then(|settings| port.set_configuration(&settings));
        changed.map_err(|error| not_opened(path, endpoint, &error))
    }

    /// Reads the available bytes, at least one. 0 bytes means that the other end has closed the connection.
    ///
    /// # Errors
    ///
    /// Errors of the port.
    pub async fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Serial(serial) => serial.port.read(bytes).await,
            Self::Tcp(stream) => stream.read(bytes).await,
        }
    }

    /// Discards bytes that the system has not sent yet. A connection cannot be used afterwards.
    pub fn discard_unsent(&self) {
        // The stream is dropped next, so a failure to discard is ignored.
        let _ = match self {
            Self::Serial(serial) => serial.port.discard_output_buffer(),
            // Closing such a connection resets it. Otherwise the system would repeat the bytes for minutes.
            Self::Tcp(stream) => stream.set_zero_linger(),
        };
    }

    /// Writes all bytes.
    ///
    /// # Errors
    ///
    /// Errors of the port.
    pub async fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Serial(serial) => serial.port.write_all(bytes).await,
            Self::Tcp(stream) => stream.write_all(bytes).await,
        }
    }
}

/// Locks the port against other programs with such a lock: two masters on one line would garble each other's answers.
/// The system removes the lock when the program ends, whatever ends it.
#[cfg(unix)]
fn lock(path: &str) -> io::Result<std::fs::File> {
    use rustix::fs::OFlags;
    use std::os::unix::fs::OpenOptionsExt;
    let flags = (OFlags::NOCTTY | OFlags::NONBLOCK).bits();
    let file = std::fs::OpenOptions::new()
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
fn exclude(file: &std::fs::File) {
    // A port that does not support this is used nevertheless.
    let _ = rustix::termios::ioctl_tiocexcl(file);
}

/// Returns whether a port is a pseudo-terminal, which transfers bytes without parity and stop bits.
pub fn is_pseudo_terminal(path: &str) -> bool {
    std::fs::canonicalize(path).is_ok_and(|path| path.starts_with("/dev/pts"))
}

/// Returns the settings of a port with rate and format of the endpoint.
fn with(mut settings: Settings, path: &str, endpoint: &Endpoint) -> io::Result<Settings> {
    settings.set_raw();
    settings.set_baud_rate(endpoint.baud)?;
    if !is_pseudo_terminal(path) {
        set_format(&mut settings, endpoint.format);
    }
    Ok(settings)
}

fn set_format(settings: &mut Settings, format: Format) {
    settings.set_char_size(if format.data_bits == 7 {
        CharSize::Bits7
    } else {
        CharSize::Bits8
    });
    settings.set_parity(match format.parity {
        Parity::Even => serial::Parity::Even,
        Parity::Odd => serial::Parity::Odd,
        Parity::None => serial::Parity::None,
    });
    settings.set_stop_bits(if format.stop_bits == 2 {
        StopBits::Two
    } else {
        StopBits::One
    });
}

/// Returns the failure for a serial port that cannot be opened.
fn not_opened(path: &str, endpoint: &Endpoint, error: &io::Error) -> Failure {
    Failure::Port(match error.kind() {
        io::ErrorKind::NotFound => {
            format!(
                "there is no port {path}; this computer has {}",
                port_names()
            )
        }
        io::ErrorKind::PermissionDenied if cfg!(windows) => {
            format!("{path} is in use: close the program that has it open")
        }
        io::ErrorKind::PermissionDenied => {
            let group = owning_group(path).unwrap_or_else(|| "dialout".to_owned());
            if group == "root" {
                // No user should join that group.
                format!(
                    "no permission for {path}, which belongs to root: change its owner with `sudo chown $USER {path}`"
                )
            } else {
                format!(
                    "no permission for {path}: add yourself to its group with `sudo usermod -aG {group} $USER` and log in again"
                )
            }
        }
        io::ErrorKind::ResourceBusy => {
            format!("{path} is in use: close the program that has it open")
        }
        io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported => format!(
            "{path} does not support {} bit/s, {} ({error}); try another adapter",
            endpoint.baud, endpoint.format
        ),
        _ => format!("{path} cannot be opened: {error}"),
    })
}

/// Returns the names of this computer's serial ports, for people.
fn port_names() -> String {
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
fn owning_group(path: &str) -> Option<String> {
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
fn owning_group(_: &str) -> Option<String> {
    None
}
