//! The examples, each run on pseudo-terminals with a master at the other end.
#![cfg(unix)]
#![allow(clippy::duplicate_mod)] // each example has the module `line`

#[path = "../examples/ascii.rs"]
#[allow(dead_code)] // its `main`
mod ascii;
#[path = "../examples/bare_metal.rs"]
#[allow(dead_code)] // its `main`
mod bare_metal;
mod common;
#[path = "../examples/rtu.rs"]
#[allow(dead_code)] // its `main`
mod rtu;
#[path = "../examples/two_lines.rs"]
#[allow(dead_code)] // its `main`
mod two_lines;

use std::thread;
use std::time::Duration;

use common::{delimiter, framed, pdu, unframed, write_words};
use modbus_server::line::Framing;
use serial2::SerialPort;

/// The master's end of a line.
struct Master {
    port: SerialPort,
    framing: Framing,
    unit: u8,
}

impl Master {
    /// Creates a line: a master, and the port of the unit.
    fn new(framing: Framing, unit: u8) -> (Self, SerialPort) {
        let (mut port, units) = SerialPort::pair().expect("a pseudo-terminal");
        // Long enough for a machine under load.
        port.set_read_timeout(Duration::from_secs(2)).unwrap();
        let master = Self {
            port,
            framing,
            unit,
        };
        (master, units)
    }

    /// Returns the PDU of the reply. Like any master, it repeats a request: the unit may not be running yet, or a
    /// busy machine may have sent the frame with a silence in it.
    fn ask(&self, pdu: &[u8]) -> Vec<u8> {
        for _ in 0..5 {
            let request = framed(delimiter(self.framing), self.unit, pdu);
            self.port.write_all(&request).unwrap();
            if let Some(reply) = self.reply() {
                return reply;
            }
        }
        panic!("no reply to {pdu:02X?}");
    }

    fn reply(&self) -> Option<Vec<u8>> {
        let mut reply = Vec::new();
        let mut byte = [0];
        while !self.is_whole(&reply) {
            self.port.read_exact(&mut byte).ok()?;
            reply.push(byte[0]);
        }
        let [unit, pdu @ ..] = &unframed(delimiter(self.framing), &reply)[..] else {
            panic!("an empty reply");
        };
        assert_eq!(*unit, self.unit);
        Some(pdu.to_vec())
    }

    /// Returns whether these bytes are a complete frame; in RTU mode of a read, a write or an exception.
    fn is_whole(&self, reply: &[u8]) -> bool {
        match (self.framing, reply) {
            (Framing::Ascii { .. }, reply) => reply.ends_with(b"\r\n"),
            (Framing::Rtu, [_, 0x01..=0x04, count, ..]) => reply.len() == 5 + usize::from(*count),
            (Framing::Rtu, [_, 0x80..=0xFF, ..]) => reply.len() == 5,
            (Framing::Rtu, reply) => reply.len() == 8,
        }
    }
}

#[test]
fn the_rtu_example_serves_its_tables() {
    let (master, unit) = Master::new(Framing::Rtu, 17);
    thread::spawn(|| rtu::run(unit));
    assert_eq!(master.ask(&pdu(0x03, &[4, 1])), [0x03, 2, 0x11, 0x11]);
    master.ask(&write_words(4, &[7, 8]));
    assert_eq!(master.ask(&pdu(0x03, &[4, 2])), [0x03, 4, 0, 7, 0, 8]);
    master.ask(&pdu(0x05, &[6, 0xFF00]));
    assert_eq!(master.ask(&pdu(0x01, &[0, 8])), [0x01, 1, 0b0100_0000]);
    assert_eq!(master.ask(&pdu(0x03, &[9, 2])), [0x83, 2], "after the end");
    assert_eq!(master.ask(&pdu(0x02, &[0, 1])), [0x82, 1], "no such table");
    let served = master.ask(&pdu(0x04, &[0, 1]));
    assert!(served[3] >= 7, "{served:02X?}");
}

#[test]
fn the_bare_metal_example_serves_its_registers() {
    let (master, unit) = Master::new(Framing::Rtu, 17);
    thread::spawn(|| bare_metal::run(unit));
    assert_eq!(master.ask(&pdu(0x03, &[4, 1])), [0x03, 2, 0x11, 0x11]);
    master.ask(&write_words(4, &[7, 8]));
    assert_eq!(master.ask(&pdu(0x03, &[4, 2])), [0x03, 4, 0, 7, 0, 8]);
    assert_eq!(master.ask(&pdu(0x03, &[9, 2])), [0x83, 2], "after the end");
}

#[test]
fn the_ascii_example_is_a_thermostat() {
    let (master, unit) = Master::new(Framing::ASCII, 17);
    thread::spawn(|| ascii::run(unit));
    assert_eq!(master.ask(&pdu(0x03, &[0, 1])), [0x03, 2, 0, 210]);
    assert_eq!(master.ask(&pdu(0x04, &[0, 1])), [0x04, 2, 0, 198]);
    let set = pdu(0x06, &[0, 225]);
    assert_eq!(master.ask(&set), set);
    assert_eq!(master.ask(&pdu(0x06, &[0, 301])), [0x86, 3], "too warm");
    assert_eq!(master.ask(&pdu(0x03, &[0, 1])), [0x03, 2, 0, 225]);
    assert_eq!(master.ask(&pdu(0x01, &[0, 1])), [0x81, 1], "no coils");
    let name = master.ask(&[0x2B, 0x0E, 4, 1]);
    assert_eq!(name[9..], *b"Thermostat");
}

#[test]
fn the_example_with_two_lines_shows_one_device_on_both() {
    let (rtu, rtu_unit) = Master::new(Framing::Rtu, 17);
    let (ascii, ascii_unit) = Master::new(Framing::ASCII, 3);
    thread::spawn(|| two_lines::run(rtu_unit, ascii_unit));
    for n in [1, 2] {
        rtu.ask(&pdu(0x06, &[2, n]));
        assert_eq!(ascii.ask(&pdu(0x03, &[2, 1])), [0x03, 2, 0, n as u8]);
        ascii.ask(&pdu(0x06, &[3, n]));
        assert_eq!(rtu.ask(&pdu(0x03, &[3, 1])), [0x03, 2, 0, n as u8]);
    }
}
