//! The release image in the running command, with a master on its TCP line.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use modbus_line::adu::Framing;

use super::{ENDS, Running, state};

/// KEY, which opens the configuration's lock with 0x5A17.
pub const KEY: u16 = 0x0100;
/// Line rate in 100 bit/s.
pub const BAUD: u16 = 0x0101;
/// The value 1 saves, 2 restarts.
pub const COMMAND: u16 = 0x0108;
/// The first channel's filter time in ms.
const FILTER: u16 = 0x0130;
/// Status register. Bit 3: changed, not saved.
const STATUS: u16 = 0x020A;

/// A simulator that runs the image, and the master on its line.
pub struct Unit {
    pub running: Running,
    pub line: TcpStream,
    pub http: String,
}

impl Unit {
    pub fn start(more: &[&str]) -> Self {
        let mut running = Running::start_firmware(&[&["--tcp", "127.0.0.1:0"][..], more].concat());
        running.skip_pty();
        let line = TcpStream::connect(running.endpoint("tcp: ")).unwrap();
        line.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
        let http = running.endpoint("http: http://");
        Self {
            running,
            line,
            http,
        }
    }

    /// Sends a PDU to unit 1. Returns `length` bytes of the reply's PDU.
    fn ask(&mut self, pdu: &[u8], length: usize) -> Vec<u8> {
        let reply = self.ask_unit(1, pdu, length);
        reply.unwrap_or_else(|| panic!("no reply to {pdu:02X?}"))
    }

    /// Sends a PDU to a unit. Returns `length` bytes of the reply's PDU. Repeats requests that are lost because the
    /// machine is too busy to keep time.
    pub fn ask_unit(&mut self, unit: u8, pdu: &[u8], length: usize) -> Option<Vec<u8>> {
        (0..10).find_map(|_| {
            let reply = self.try_unit(unit, pdu, length)?;
            let (address, pdu) = Framing::Rtu.open(&reply).expect("a valid CRC");
            assert_eq!(address, unit);
            Some(pdu)
        })
    }

    /// Sends a request once and returns the reply unchecked: `length` bytes of PDU with address and CRC.
    pub fn try_unit(&mut self, unit: u8, pdu: &[u8], length: usize) -> Option<Vec<u8>> {
        // The silence in front of a frame.
        std::thread::sleep(Duration::from_millis(20));
        let request = Framing::Rtu.frame(0, unit, pdu);
        self.line.write_all(&request).unwrap();
        let mut reply = vec![0; length + 3];
        self.line.read_exact(&mut reply).ok().map(|()| reply)
    }

    pub fn read(&mut self, address: u16) -> u16 {
        let [high, low] = address.to_be_bytes();
        let reply = self.ask(&[3, high, low, 0, 1], 4);
        assert_eq!(reply[..2], [3, 2]);
        u16::from_be_bytes([reply[2], reply[3]])
    }

    pub fn write(&mut self, address: u16, value: u16) {
        let pdu = [&[6][..], &address.to_be_bytes(), &value.to_be_bytes()].concat();
        assert_eq!(self.ask(&pdu, 5), pdu);
    }

    /// Saves `value` as the filter time.
    pub fn save_filter(&mut self, value: u16) {
        self.write(KEY, 0x5A17);
        self.write(FILTER, value);
        self.save();
    }

    pub fn save(&mut self) {
        self.write(COMMAND, 1);
        while self.read(STATUS) & 8 != 0 {}
    }

    /// Returns the rate of the simulator's end of the line.
    pub fn rate(&self) -> u64 {
        state(&self.http)["line"]["baud"].as_u64().unwrap()
    }

    /// Ends the simulator by one of [`ENDS`].
    pub fn end(mut self, (signal, status): (&str, Option<i32>)) {
        self.running.signal(signal);
        assert_eq!(self.running.end().0, status, "{signal}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn saved_configuration_survives_every_kind_of_end_of_the_simulator() {
    let directory = tempfile::tempdir().unwrap();
    let flash = directory.path().join("flash");
    let option = ["--flash", flash.to_str().unwrap()];
    let mut stored = 5;
    for (value, end) in (50..).zip(ENDS) {
        let mut unit = Unit::start(&option);
        assert_eq!(unit.read(FILTER), stored);
        unit.save_filter(value);
        unit.end(*end);
        assert_eq!(std::fs::metadata(&flash).unwrap().len(), 128 * 1024);
        stored = value;
    }
    // Another image is written over its own pages, which do not include those of the stored configuration.
    let other = super::endless_loop(directory.path());
    let more = [["--for", "10ms"], option].concat();
    let mut running = Running::start_image(other.to_str().unwrap(), &more);
    assert_eq!(running.end().0, Some(0));
    let mut unit = Unit::start(&option);
    assert_eq!(unit.read(FILTER), stored);
    unit.end(ENDS[0]);
}
