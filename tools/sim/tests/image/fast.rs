//! Function 70 on a bus: units arbitrate with real start bits, different crystals and late interrupts.

use register_map::codes::Baud;
use register_map::configuration::{BAUD, FORMAT};
use sim::line::Settings;
use sim::{Board, Bus, Config, Module, Time};

use crate::LAYOUT;
use crate::bench::{FIRST, PORT, adu, config, corner, crc, format, image};

/// A bus with a master that knows function 70.
struct Master {
    bus: Bus,
    settings: Settings,
}

/// A unit: its switch and the error of its crystal in ppm; `None` without a crystal.
type Unit = (u8, Option<i32>);

impl Master {
    /// Returns a bus with these units, with time to start.
    fn new(baud: Baud, format_code: u16, units: &[Unit]) -> Self {
        let boards = units.iter().zip(0..).map(|(unit, n)| {
            let stored = [(BAUD, baud.code()), (FORMAT, format_code)];
            board(*unit, n, &stored)
        });
        let mut bus = Bus::new(boards.collect());
        let settings = Settings {
            baud: baud.bits_per_second(),
            format: format(format_code),
        };
        bus.line().set_settings(settings);
        bus.run_for(Time::from_ms(300));
        Self { bus, settings }
    }

    /// Sends a request without its CRC. Returns the reply without its CRC, and what was received in front of it.
    fn ask(&mut self, request: &[u8], windows: u64) -> Option<(Vec<u8>, Vec<u8>)> {
        let now = self.bus.now();
        let end = self.bus.line().send(now, &adu(request));
        let bits = |n| self.settings.rate().bits(n);
        let window = bits(13) + Time::from_us(50);
        let start = bits(39).max(bits(12) + Time::from_us(800));
        let arbitration = start + Time::from_ps(window.as_ps() * windows);
        let reply = self.settings.characters(72);
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

    fn scan(&mut self, start: bool) -> Option<Vec<u8>> {
        let request = [0xFD, 0x46, if start { 1 } else { 2 }];
        self.ask(&request, 32).map(|(reply, _)| reply)
    }

    /// Scans the bus. Returns the serial numbers and addresses in the order in which they were found.
    fn find_all(&mut self) -> Vec<(u32, u8)> {
        let mut found = Vec::new();
        let mut reply = self.scan(true).expect("a reply");
        while let [0xFD, 0x46, 3, a, b, c, d, unit] = reply[..] {
            found.push((u32::from_be_bytes([a, b, c, d]), unit));
            reply = self.scan(false).expect("a reply");
        }
        assert_eq!(reply, [0xFD, 0x46, 4]);
        found
    }

    fn fetch(&mut self, confirmed: u8, flag: u8) -> Vec<u8> {
        let request = [0xFD, 0x46, 0x10, 0, 100, confirmed, flag];
        self.ask(&request, 12).expect("a reply").0
    }
}

fn board((dip, ppm): Unit, n: u8, stored: &[(u16, u16)]) -> Board {
    let mut config = Config {
        dip,
        layout: LAYOUT,
        ..config(Module::Di4, stored)
    };
    config.chip.corner = corner();
    config.chip.unique_id[11] = n;
    match ppm {
        Some(ppm) => config.chip.crystal_hz = (8_000_000 + 8 * ppm) as u32,
        None => config.chip.crystal = false,
    }
    Board::new(image(), config).expect("the image fits")
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_scan_finds_every_unit_once_also_two_with_one_address() {
    let units = [
        (17, Some(200)),
        (5, Some(-200)),
        (17, Some(0)),
        (200, Some(-100)),
        (0, Some(150)),
    ];
    for (baud, format) in [
        (Baud::B1200, 0),
        (Baud::B9600, 0),
        (Baud::B19200, 3),
        (Baud::B115200, 0),
        (Baud::B230400, 2),
        (Baud::B921600, 0),
        (Baud::B921600, 1),
    ] {
        let mut master = Master::new(baud, format, &units);
        let found = master.find_all();
        let mut sorted = found.clone();
        sorted.sort_unstable();
        assert_eq!(
            found, sorted,
            "the lowest serial number comes first: {baud:?}"
        );
        let mut addresses: Vec<u8> = found.iter().map(|(_, unit)| *unit).collect();
        addresses.sort_unstable();
        assert_eq!(addresses, [0, 5, 17, 17, 200], "{baud:?}");
        // Each is reached by its serial number.
        for (serial, unit) in found {
            let request = [
                &[0xFD, 0x46, 8],
                &serial.to_be_bytes()[..],
                &[3, 2, 6, 0, 1],
            ]
            .concat();
            let (reply, _) = master.ask(&request, 0).expect("a reply");
            assert_eq!(reply[..3], [0xFD, 0x46, 9]);
            assert_eq!(reply[7..], [3, 2, 0, unit]);
        }
    }
}
