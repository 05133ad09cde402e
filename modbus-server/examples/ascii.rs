//! A thermostat, unit 17 in ASCII mode on a serial port: `cargo run --example ascii -- /dev/ttyUSB0`.
//!
//! It implements the data model itself, because its setpoint has limits and it has device identification.

mod line;

use std::io;

use line::Line;
use modbus_server::{DataModel, Exception, Function, Span, Table, TextOut, Words, WordsOut};
use serial2::SerialPort;

fn main() -> io::Result<()> {
    run(line::port(1, 19200)?)
}

/// Serves the line until the port fails.
pub fn run(port: SerialPort) -> io::Result<()> {
    let mut thermostat = Thermostat {
        setpoint: 210,
        measured: 198,
    };
    let mut line = Line::ascii(port, 17)?;
    loop {
        line.request()?;
        line.serve(&mut thermostat)?;
    }
}

/// Holding register 0 is the setpoint, input register 0 the measured temperature, both in tenths of
/// a degree Celsius.
struct Thermostat {
    setpoint: u16,
    measured: u16,
}

impl DataModel for Thermostat {
    fn has(&self, function: Function) -> bool {
        !matches!(
            function,
            Function::ReadCoils
                | Function::ReadDiscreteInputs
                | Function::WriteSingleCoil
                | Function::WriteMultipleCoils
        )
    }

    fn check_read_words(&self, _: Table, span: Span) -> Result<(), Exception> {
        if span == Span::single(0) {
            Ok(())
        } else {
            Err(Exception::IllegalDataAddress)
        }
    }

    fn check_write_words(&self, span: Span, words: Words<'_>) -> Result<(), Exception> {
        self.check_read_words(Table::HoldingRegisters, span)?;
        if words.iter().all(|setpoint| (50..=300).contains(&setpoint)) {
            Ok(())
        } else {
            Err(Exception::IllegalDataValue)
        }
    }

    fn read_words(&self, table: Table, _: Span, out: &mut WordsOut<'_>) {
        out.push(match table {
            Table::InputRegisters => self.measured,
            _ => self.setpoint,
        });
    }

    fn write_words(&mut self, _: Span, words: Words<'_>) {
        self.setpoint = words.get(0).unwrap_or(self.setpoint);
    }

    fn identification(&self, object: u8, text: &mut TextOut<'_>) -> bool {
        match object {
            0x00 => text.extend(b"Example company"),
            0x01 => text.extend(b"Thermostat"),
            0x02 => text.extend(env!("CARGO_PKG_VERSION").as_bytes()),
            _ => return false,
        }
        true
    }
}
