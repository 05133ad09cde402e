//! One device on two lines, RTU on the first and ASCII on the second:
//! `cargo run --example two_lines -- /dev/ttyUSB0 /dev/ttyUSB1`.
//!
//! Each line has its own port and its own server, with its own counters and its own unit
//! address. Both use the same data model, one request at a time.

mod line;

use std::io;
use std::sync::{Mutex, PoisonError};
use std::thread;

use line::Line;
use modbus_server::Tables;
use serial2::SerialPort;

fn main() -> io::Result<()> {
    run(line::port(1, 19200)?, line::port(2, 9600)?)
}

/// Serves both lines until both ports have failed.
pub fn run(rtu: SerialPort, ascii: SerialPort) -> io::Result<()> {
    let mut setpoints = [0; 10];
    let tables = Mutex::new(Tables {
        holding_registers: &mut setpoints,
        ..Tables::default()
    });
    let (rtu, ascii) = (Line::rtu(rtu, 17)?, Line::ascii(ascii, 3)?);
    thread::scope(|threads| {
        threads.spawn(|| serve(rtu, &tables));
        serve(ascii, &tables)
    })
}

fn serve(mut line: Line, tables: &Mutex<Tables<'_>>) -> io::Result<()> {
    loop {
        line.request()?;
        let mut tables = tables.lock().unwrap_or_else(PoisonError::into_inner);
        line.serve(&mut *tables)?;
    }
}
