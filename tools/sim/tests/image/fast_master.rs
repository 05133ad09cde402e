//! A master that knows function 70, on a bus of boards.

use register_map::codes::Baud;
use sim::line::Settings;
use sim::{Board, Bus, Time};

use crate::rig::{adu, crc, format};

/// A bus with a master that knows function 70.
pub struct Master {
    pub bus: Bus,
    settings: Settings,
}

impl Master {
    /// Returns a bus with these boards, which have these settings of the line, with time to start. Every other board is
    /// at the far end of 1,200 m of cable.
    pub fn new(baud: Baud, format_code: u16, boards: Vec<Board>) -> Self {
        let mut bus = Bus::new(boards);
        for n in (1..bus.len()).step_by(2) {
            bus.set_distance(n, 1200);
        }
        let settings = Settings {
            baud: baud.bits_per_second(),
            format: format(format_code),
        };
        bus.line().set_settings(settings);
        bus.run_for(Time::from_ms(300));
        Self { bus, settings }
    }

    /// Sends a request without its CRC. Returns the reply without its CRC, and what was received in front of it.
    pub fn ask(&mut self, request: &[u8], windows: u64) -> Option<(Vec<u8>, Vec<u8>)> {
        let now = self.bus.now();
        let end = self.bus.line().send(now, &adu(request));
        let bits = |n| self.settings.rate().bits(n);
        let window = bits(13) + Time::from_us(50);
        let start = bits(39).max(bits(12) + Time::from_us(800));
        let arbitration = start + Time::from_ps(window.as_ps() * windows);
        // A reply to a request to a unit's own address has t3.5 in front of it and behind it.
        let reply = self.settings.characters(72 + 8) + Time::from_ms(4);
        self.bus.run_until(end + arbitration + reply);
        let received = self.bus.line().take_received();
        let bytes: Vec<u8> = received.iter().map(|received| received.byte).collect();
        // The reply is the shortest end of what was received with a valid CRC.
        let at = (0..bytes.len().checked_sub(4)?).rev().find(|at| {
            let (body, sum) = bytes[*at..].split_at(bytes.len() - at - 2);
            crc(body) == sum
        })?;
        Some((bytes[at..bytes.len() - 2].to_vec(), bytes[..at].to_vec()))
    }

    pub fn scan(&mut self, start: bool) -> Option<Vec<u8>> {
        let request = [0xFD, 0x46, if start { 1 } else { 2 }];
        self.ask(&request, 32).map(|(reply, _)| reply)
    }

    /// Scans the bus. Returns the serial numbers and addresses in the order in which they were found.
    pub fn find_all(&mut self) -> Vec<(u32, u8)> {
        let mut found = Vec::new();
        let mut reply = self.scan(true).expect("a reply");
        while let [0xFD, 0x46, 3, a, b, c, d, unit] = reply[..] {
            found.push((u32::from_be_bytes([a, b, c, d]), unit));
            reply = self.scan(false).expect("a reply");
        }
        assert_eq!(reply, [0xFD, 0x46, 4]);
        found
    }

    pub fn fetch(&mut self, confirmed: u8, flag: u8) -> Vec<u8> {
        let request = [0xFD, 0x46, 0x10, 0, 100, confirmed, flag];
        self.ask(&request, 12).expect("a reply").0
    }
}
