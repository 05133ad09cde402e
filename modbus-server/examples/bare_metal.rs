//! Unit 17 in RTU mode without an operating system: [`Unit`] needs a UART that implements embedded-io, the transceiver's
//! driver enable as an embedded-hal pin, and a clock in microseconds. It neither allocates nor uses the standard library.
//!
//! To try it, `main` uses a serial port of a computer: `cargo run --example bare_metal -- /dev/ttyUSB0`.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType as PinErrorType, OutputPin};
use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write};
use modbus_server::line::{Faults, Framing, Port, Receiver, Silences, TimedPort};
use modbus_server::{Adu, DataModel, Server, Tables};
use serial2::SerialPort;

/// A unit on a line.
pub struct Unit<S, D> {
    serial: S,
    driver: D,
    port: TimedPort<'static>,
    server: Server,
}

impl<S: Read + ReadReady + Write, D: OutputPin> Unit<S, D> {
    /// Creates the unit with this address, 1 to 247, at `now` microseconds. At 19200 bit/s the silences are
    /// `Silences::rtu(&Gaps::standard(19_200, 11), 1_000)`.
    pub fn new(
        serial: S,
        driver: D,
        unit: u8,
        silences: Silences,
        adus: &'static mut [Adu; 2],
        now: u32,
    ) -> Self {
        let port = Port::new(Receiver::rtu(unit, false), adus);
        Self {
            serial,
            driver,
            port: TimedPort::new(port, silences, now),
            server: Server::new(Framing::Rtu),
        }
    }

    /// Serves the line. Call this repeatedly, at `now` microseconds, which wrap: more often than the shorter
    /// silence, so that no silence is missed.
    pub fn poll(&mut self, now: u32, model: &mut impl DataModel) -> Result<(), S::Error> {
        let mut waits = self.port.poll(now);
        while !waits && self.serial.read_ready()? {
            let mut byte = [0];
            if self.serial.read(&mut byte)? == 0 {
                break;
            }
            waits = self.port.received(byte[0], Faults::NONE, now);
        }
        let port = self.port.port();
        if let Some(request) = port.take() {
            port.send(self.server.serve(request, model), 0);
            self.send()?;
        }
        Ok(())
    }

    fn send(&mut self) -> Result<(), S::Error> {
        let Some(first) = self.port.port().start() else {
            return Ok(());
        };
        // A pin of the microcontroller itself does not fail.
        let _ = self.driver.set_high();
        let mut result = self.serial.write_all(&[first]);
        while let Some(byte) = self.port.port().next_byte() {
            result = result.and_then(|()| self.serial.write_all(&[byte]));
        }
        // `flush` must return exactly when the last stop bit has been sent: from then on the master may use the
        // bus.
        let result = result.and_then(|()| self.serial.flush());
        let _ = self.driver.set_low();
        self.port.sent();
        result
    }
}

fn main() -> std::io::Result<()> {
    let path = std::env::args().nth(1).expect("a serial port");
    run(SerialPort::open(path, 19200)?)
}

/// Serves the line until the port fails.
pub fn run(port: SerialPort) -> std::io::Result<()> {
    let uart = Uart::new(port)?;
    // A computer sometimes reads late; that must not end a frame.
    let silences = Silences {
        short: 20_000,
        long: 20_000,
    };
    let adus = Box::leak(Box::new([Adu::new(), Adu::new()]));
    let begun = std::time::Instant::now();
    let mut unit = Unit::new(uart, NoDriver, 17, silences, adus, 0);
    let mut registers = [0x1111; 10];
    let mut tables = Tables {
        holding_registers: &mut registers,
        ..Tables::default()
    };
    loop {
        // The count of microseconds wraps.
        let now = begun.elapsed().as_micros() as u32;
        unit.poll(now, &mut tables)
            .map_err(|error| std::io::Error::other(format!("{error:?}")))?;
    }
}

/// The serial port of a computer as a UART.
struct Uart {
    port: SerialPort,
    waiting: Option<u8>,
}

impl Uart {
    fn new(mut port: SerialPort) -> std::io::Result<Self> {
        port.set_read_timeout(std::time::Duration::from_millis(1))?;
        Ok(Self {
            port,
            waiting: None,
        })
    }
}

impl ErrorType for Uart {
    type Error = ErrorKind;
}

impl ReadReady for Uart {
    fn read_ready(&mut self) -> Result<bool, ErrorKind> {
        let mut byte = [0];
        if self.waiting.is_none() {
            match self.port.read(&mut byte) {
                Ok(0) => return Err(ErrorKind::BrokenPipe),
                Ok(_) => self.waiting = Some(byte[0]),
                Err(error) if error.kind() == std::io::ErrorKind::TimedOut => {}
                Err(_) => return Err(ErrorKind::Other),
            }
        }
        Ok(self.waiting.is_some())
    }
}

impl Read for Uart {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        while !self.read_ready()? {}
        let (Some(place), Some(byte)) = (buffer.first_mut(), self.waiting.take()) else {
            return Ok(0);
        };
        *place = byte;
        Ok(1)
    }
}

impl Write for Uart {
    fn write(&mut self, buffer: &[u8]) -> Result<usize, ErrorKind> {
        self.port.write(buffer).map_err(|_| ErrorKind::Other)
    }

    fn flush(&mut self) -> Result<(), ErrorKind> {
        self.port.flush().map_err(|_| ErrorKind::Other)
    }
}

/// The driver enable of an adapter that switches its transceiver automatically.
struct NoDriver;

impl PinErrorType for NoDriver {
    type Error = Infallible;
}

impl OutputPin for NoDriver {
    fn set_low(&mut self) -> Result<(), Infallible> {
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
