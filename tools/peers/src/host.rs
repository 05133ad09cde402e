//! A server on a serial port. Frames end by silence.

use std::io::{self, ErrorKind};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use std::println;
use std::vec::Vec;

use serial2::{FlowControl, Parity, SerialPort, Settings, StopBits};

use crate::{LONGEST, Server};

/// Rate of the line, in bit/s.
const BAUD: u32 = 19_200;
/// Silence that ends a frame. t3.5 is 2 ms at 19200 bit/s, but a busy host delivers bytes late. The conformance
/// suite makes no silence shorter than 100 ms on a serial port.
const SILENCE: Duration = Duration::from_millis(20);
/// Time to wait for the first byte before the server waits again.
const IDLE: Duration = Duration::from_secs(1);

/// Serves the line at `port` without end. Prints `ready` in a line when the port is open.
///
/// Frames that are longer than the standard allows are discarded. A frame that makes the server panic gets no reply; the
/// next frame is served as usual.
///
/// # Errors
///
/// When the port cannot be opened, or can no longer be used.
fn serve(port: &str, mut server: impl Server) -> io::Result<()> {
    let mut line = SerialPort::open(port, |mut settings: Settings| {
        settings.set_raw();
        settings.set_baud_rate(BAUD)?;
        settings.set_parity(Parity::None);
        settings.set_stop_bits(StopBits::Two);
        settings.set_flow_control(FlowControl::None);
        Ok(settings)
    })?;
    println!("ready");
    loop {
        let frame = receive(&mut line)?;
        if frame.len() > LONGEST {
            continue;
        }
        // The panic has already been reported on the standard error output.
        let mut reply = [0; LONGEST];
        let answer = catch_unwind(AssertUnwindSafe(|| server.answer(&frame, &mut reply)));
        if let Ok(Some(length)) = answer {
            line.write_all(&reply[..length])?;
        }
    }
}

/// Waits for bytes, and returns all of them up to the next silence.
fn receive(line: &mut SerialPort) -> io::Result<Vec<u8>> {
    let mut frame = Vec::new();
    let mut buffer = [0; 512];
    loop {
        line.set_read_timeout(if frame.is_empty() { IDLE } else { SILENCE })?;
        match line.read(&mut buffer) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(length) => frame.extend_from_slice(&buffer[..length]),
            Err(error) if error.kind() == ErrorKind::TimedOut && frame.is_empty() => {}
            Err(error) if error.kind() == ErrorKind::TimedOut => return Ok(frame),
            Err(error) => return Err(error),
        }
    }
}

/// Runs a server on the port that the command line names, until the line fails.
///
/// # Errors
///
/// When the command line names no port, or when the port cannot be opened or can no longer be used.
pub fn main(server: impl Server) -> io::Result<()> {
    let port = std::env::args()
        .nth(1)
        .ok_or_else(|| io::Error::new(ErrorKind::InvalidInput, "name a serial port"))?;
    serve(&port, server)
}
