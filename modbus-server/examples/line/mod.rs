//! Shared by the examples: a unit on a serial port of a computer.
//!
//! A computer only estimates the silences of a line: it detects them when no byte has arrived for a while. A
//! microcontroller restarts a timer with each byte instead.

use std::io::{self, ErrorKind};
use std::time::{Duration, Instant};

use modbus_server::line::{Faults, Framing, Port, Receiver, Silences, TimedPort, Width};
use modbus_server::{Adu, DataModel, Server};
use serial2::SerialPort;

/// The long silence. A tick of the port's clock is a microsecond. USB adapters pass on received bytes about every
/// 16 ms, which must not end a frame.
const SILENCE: u32 = 20_000;
/// Time limit for an ASCII frame without its end.
const TIME_OUT: u32 = 1_000_000;

/// A serial port and the unit on it.
pub struct Line {
    serial: SerialPort,
    begun: Instant,
    port: TimedPort<'static>,
    server: Server,
}

#[allow(dead_code, reason = "not every example has lines of both modes")]
impl Line {
    /// Opens a unit in RTU mode.
    pub fn rtu(serial: SerialPort, unit: u8) -> io::Result<Self> {
        let silences = Silences {
            short: SILENCE,
            long: SILENCE,
        };
        let server = Server::new(Framing::Rtu);
        Self::new(serial, Receiver::rtu(unit, false), silences, server)
    }

    /// Opens a unit in ASCII mode, where a frame has an end mark.
    pub fn ascii(serial: SerialPort, unit: u8) -> io::Result<Self> {
        let silences = Silences {
            short: SILENCE,
            long: TIME_OUT,
        };
        let server = Server::new(Framing::ASCII);
        Self::new(
            serial,
            Receiver::ascii(unit, Width::Eight),
            silences,
            server,
        )
    }

    fn new(
        mut serial: SerialPort,
        receiver: Receiver<'static>,
        silences: Silences,
        server: Server,
    ) -> io::Result<Self> {
        serial.set_read_timeout(Duration::from_millis(5))?;
        let adus = Box::leak(Box::new([Adu::new(), Adu::new()]));
        Ok(Self {
            serial,
            begun: Instant::now(),
            port: TimedPort::new(Port::new(receiver, adus), silences, 0),
            server,
        })
    }

    /// Waits for the next valid request to this unit or to all units.
    pub fn request(&mut self) -> io::Result<()> {
        loop {
            let mut byte = [0];
            let read = self.serial.read(&mut byte);
            // The count wraps.
            let now = self.begun.elapsed().as_micros() as u32;
            let waits = match read {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(_) => self.port.received(byte[0], Faults::NONE, now),
                Err(error) if error.kind() == ErrorKind::TimedOut => self.port.poll(now),
                Err(error) => return Err(error),
            };
            if waits {
                return Ok(());
            }
        }
    }

    /// Serves the request and sends the reply, if there is one.
    pub fn serve(&mut self, model: &mut impl DataModel) -> io::Result<()> {
        let port = self.port.port();
        let Some(request) = port.take() else {
            return Ok(());
        };
        port.send(self.server.serve(request, model), 0);
        let Some(first) = port.start() else {
            return Ok(());
        };
        let mut reply = vec![first];
        while let Some(byte) = port.next_byte() {
            reply.push(byte);
        }
        self.port.sent();
        self.serial.write_all(&reply)
    }
}

/// Opens the serial port or pseudo-terminal that is the `n`th argument of the program.
pub fn port(n: usize, baud: u32) -> io::Result<SerialPort> {
    let path = std::env::args().nth(n).ok_or_else(|| {
        let text = format!("argument {n} is missing: the path of a serial port or pseudo-terminal");
        io::Error::new(ErrorKind::InvalidInput, text)
    })?;
    SerialPort::open(path, baud)
}
