//! What the examples share: a unit on a serial port of a computer.
//!
//! A computer only estimates the silences of a line: it notices them when no byte has arrived for a
//! while. A microcontroller restarts a timer with each byte instead.

use std::io::{self, ErrorKind};
use std::time::Duration;

use modbus_server::line::{Closed, Faults, Framing, Next, Receiver, Transmitter, Width};
use modbus_server::{Adu, DataModel, Server};
use serial2::SerialPort;

/// A serial port, and the unit on it.
pub struct Line {
    port: SerialPort,
    receiver: Receiver<'static>,
    server: Server,
}

#[allow(dead_code, reason = "not every example has lines of both modes")]
impl Line {
    /// A unit in RTU mode. A frame ends with a silence of 20 ms, because USB adapters hand over what
    /// they have received every 16 ms or so.
    pub fn rtu(port: SerialPort, unit: u8) -> io::Result<Self> {
        let receiver = Receiver::rtu(unit, false);
        let server = Server::new(unit, Framing::Rtu);
        Self::new(port, receiver, server, Duration::from_millis(20))
    }

    /// A unit in ASCII mode, where a frame has an end mark. A frame without one ends after a second.
    pub fn ascii(port: SerialPort, unit: u8) -> io::Result<Self> {
        let receiver = Receiver::ascii(unit, Width::Eight);
        let server = Server::new(unit, Framing::ASCII);
        Self::new(port, receiver, server, Duration::from_secs(1))
    }

    fn new(
        mut port: SerialPort,
        mut receiver: Receiver<'static>,
        server: Server,
        silence: Duration,
    ) -> io::Result<Self> {
        port.set_read_timeout(silence)?;
        for _ in 0..2 {
            receiver.give_back(Box::leak(Box::new(Adu::new())));
        }
        Ok(Self {
            port,
            receiver,
            server,
        })
    }

    /// Waits for the next good request to this unit or to all units.
    pub fn request(&mut self) -> io::Result<Closed<'static>> {
        loop {
            let mut byte = [0];
            match self.port.read(&mut byte) {
                Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
                Ok(_) => self.receiver.character(byte[0], Faults::NONE),
                Err(error) if error.kind() == ErrorKind::TimedOut => {
                    if let Some(closed) = self.receiver.close() {
                        return Ok(closed);
                    }
                }
                Err(error) => return Err(error),
            }
            if self.receiver.is_over()
                && let Some(closed) = self.receiver.close()
            {
                return Ok(closed);
            }
        }
    }

    /// Serves a request and sends the reply, if there is one.
    pub fn serve(&mut self, closed: Closed<'static>, model: &mut impl DataModel) -> io::Result<()> {
        let Self {
            port,
            receiver,
            server,
        } = self;
        let mut transmitter = if server.answers(closed.adu) {
            Transmitter::open(server.unit(), server.framing())
        } else {
            Transmitter::idle()
        };
        let decision = server.decide(closed.adu, model);
        if let Some(head) = decision.reply {
            transmitter.head(head);
        }
        server.commit(&decision, &closed.line);
        server.carry_out(&decision, closed.adu, model);
        receiver.set_framing(server.framing());
        if let Some(unneeded) = transmitter.body(closed.adu) {
            receiver.give_back(unneeded);
        }
        let mut reply = Vec::new();
        while let Next::Byte(byte) = transmitter.next() {
            reply.push(byte);
        }
        if let Some(sent) = transmitter.take_buffer() {
            receiver.give_back(sent);
        }
        port.write_all(&reply)
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
