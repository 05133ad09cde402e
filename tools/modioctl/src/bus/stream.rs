//! The connection for the bytes: a serial port, or a TCP connection.

use std::io;
use std::path::Path;
use std::time::Duration;

use modbus_line::port::{Port, is_pseudo_terminal, refusal};
use modbus_line::{Format, LineFormat};
use serial2_tokio::{IntoSettings as _, SerialPort};
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
    Serial(Port<SerialPort>),
    /// A connection.
    Tcp(TcpStream),
}

impl Stream {
    /// Opens the connection.
    pub async fn open(endpoint: &Endpoint) -> Result<Self, Failure> {
        match &endpoint.place {
            Place::Serial(path) => {
                let path = Path::new(path);
                let opened = Port::open(path, settings(path, endpoint), SerialPort::open);
                let port = opened.map_err(Failure::Port)?;
                // Bytes received before are not part of any answer.
                let _ = port.inner.discard_buffers();
                Ok(Self::Serial(port))
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
    pub fn change(&mut self, endpoint: &Endpoint) -> Result<(), Failure> {
        let (Self::Serial(port), Place::Serial(path)) = (self, &endpoint.place) else {
            return Ok(());
        };
        let path = Path::new(path);
        let line = settings(path, endpoint);
        let mut change = || {
            let mut settings = port.inner.get_configuration()?;
            line.apply_to_settings(&mut settings)?;
            port.inner.set_configuration(&settings)
        };
        change().map_err(|error| Failure::Port(refusal(path, line, &error)))
    }

    /// Reads the available bytes, at least one. 0 bytes means that the other end has closed the connection.
    pub async fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Serial(port) => port.inner.read(bytes).await,
            Self::Tcp(stream) => stream.read(bytes).await,
        }
    }

    /// Discards bytes that the system has not sent yet. A connection cannot be used afterwards.
    pub fn discard_unsent(&self) {
        // The stream is dropped next, so a failure to discard is ignored.
        let _ = match self {
            Self::Serial(port) => port.inner.discard_output_buffer(),
            // Closing such a connection resets it. Otherwise the system would repeat the bytes for minutes.
            Self::Tcp(stream) => stream.set_zero_linger(),
        };
    }

    /// Writes all bytes.
    pub async fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Serial(port) => port.inner.write_all(bytes).await,
            Self::Tcp(stream) => stream.write_all(bytes).await,
        }
    }
}

/// Returns rate and format of the port: a pseudo-terminal has a rate only.
fn settings(path: &Path, endpoint: &Endpoint) -> LineFormat {
    let mut line = endpoint.line();
    if is_pseudo_terminal(path) {
        line.format = Format {
            stop_bits: 1,
            ..Format::default()
        };
    }
    line
}
