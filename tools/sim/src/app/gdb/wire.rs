//! The way back to the debugger.

use std::io::{self, Write};
use std::net::{Shutdown, TcpStream};
use std::time::Duration;

use gdbstub::conn::Connection;

/// A debugger that does not read for this long is given up: the board's thread waits for it.
const PATIENCE: Duration = Duration::from_secs(2);

/// The way to the debugger, which sends whole packets. The connection is closed when it is dropped.
#[derive(Debug)]
pub struct Wire {
    stream: TcpStream,
    packet: Vec<u8>,
}

impl Wire {
    /// The way to the debugger at the other end of `stream`.
    ///
    /// # Errors
    ///
    /// When it has gone already.
    pub fn new(stream: TcpStream) -> io::Result<Self> {
        stream.set_write_timeout(Some(PATIENCE))?;
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
        let sent = Write::write_all(&mut self.stream, &self.packet);
        self.packet.clear();
        sent
    }
}

impl Drop for Wire {
    fn drop(&mut self) {
        // The reading thread then ends, too; that it is closed already does not matter.
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}
