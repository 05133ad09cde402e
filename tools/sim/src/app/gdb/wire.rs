//! The connection to the debugger, for writing.

use std::io::{self, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use gdbstub::conn::Connection;

/// A debugger that takes longer to read a packet is disconnected, because the boards' thread waits for it.
const PATIENCE: Duration = Duration::from_secs(2);

/// Sends whole packets to the debugger. Dropping this closes the connection.
#[derive(Debug)]
pub struct Wire {
    stream: TcpStream,
    packet: Vec<u8>,
}

impl Wire {
    /// Prepares `stream` for sending packets to the debugger.
    ///
    /// # Errors
    ///
    /// The debugger has already disconnected.
    pub fn new(stream: TcpStream) -> io::Result<Self> {
        stream.set_nodelay(true)?;
        Ok(Self {
            stream,
            packet: Vec::new(),
        })
    }
}

impl Connection for Wire {
    type Error = io::Error;

    fn write(&mut self, byte: u8) -> io::Result<()> {
        self.packet.push(byte);
        Ok(())
    }

    fn flush(&mut self) -> io::Result<()> {
        let packet = std::mem::take(&mut self.packet);
        let (mut rest, end) = (&packet[..], Instant::now() + PATIENCE);
        while !rest.is_empty() {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(io::ErrorKind::TimedOut.into());
            }
            self.stream.set_write_timeout(Some(left))?;
            match Write::write(&mut self.stream, rest)? {
                0 => return Err(io::ErrorKind::WriteZero.into()),
                sent => rest = &rest[sent..],
            }
        }
        Ok(())
    }
}

impl Drop for Wire {
    fn drop(&mut self) {
        // This also ends the reading thread. An error means that the connection is already closed.
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}
