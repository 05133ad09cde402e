//! Unit 17 in RTU mode on a serial port: `cargo run --example rtu -- /dev/ttyUSB0`.
//!
//! To try it without a serial port, connect two pseudo-terminals, run the example on one of them and
//! a master on the other:
//!
//! ```console
//! $ socat -d -d pty,raw,echo=0 pty,raw,echo=0
//! $ mbpoll -m rtu -b 19200 -P none -a 17 -0 -r 4 -c 2 -1 /dev/pts/5
//! ```

mod line;

use std::io;

use line::Line;
use modbus_server::Tables;
use serial2::SerialPort;

fn main() -> io::Result<()> {
    run(line::port(1, 19200)?)
}

/// Serves the line until the port fails.
pub fn run(port: SerialPort) -> io::Result<()> {
    let (mut relays, mut setpoints, mut served) = ([false; 8], [0x1111; 10], [0]);
    let mut tables = Tables {
        coils: &mut relays,
        holding_registers: &mut setpoints,
        input_registers: &mut served,
        ..Tables::default()
    };
    let mut line = Line::rtu(port, 17)?;
    loop {
        line.request()?;
        // The program may use the tables between two requests. Here it counts the requests.
        tables.input_registers[0] = tables.input_registers[0].wrapping_add(1);
        line.serve(&mut tables)?;
    }
}
