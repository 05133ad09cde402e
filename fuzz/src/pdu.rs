//! Target `pdu`: requests of any content to one server, one after another, in RTU or ASCII mode.
//!
//! Reply, points, counters and modes must equal those of the server of modbus-reference. This checks that the CRC
//! or LRC is correct, an exception has the right form, a rejected request changes nothing, and a broadcast is never
//! answered.
//!
//! ```text
//!   script: settings (1: ASCII, the rest: which functions are missing), first read-only point, requests
//!   request: tag, length, bytes
//!     tag & 3:  0 a PDU to this unit  1 to all  2 any unit and PDU  3 a number of damaged frames
//!     tag >> 5: the exception for the device's state, from then on; 0 to 2: none
//! ```

use std::sync::LazyLock;

use modbus_reference::{Device, Server, UNIT, framed, unframed};
use modbus_server::Adu;
use modbus_server::line::{Faults, Framing, Port, Receiver, Width};

use crate::common::{self, Points, UnitOn, delimiter};
use crate::script::Script;

/// More bits than one request may write, more words than one request may read, and an end that tests can reach.
static DEVICE: LazyLock<Device> = LazyLock::new(|| {
    let mut device = Device::new(0, 0);
    // Each table has other values and another end.
    let bits = |count: u32, most| (0..count).map(move |n| n * n % 7 < most).collect();
    let words = |count: u16, by| (0..count).map(move |n| n.wrapping_mul(by)).collect();
    device.bits = bits(2010, 3);
    device.input_bits = bits(2005, 2);
    device.words = words(130, 0x9E37);
    device.input_words = words(127, 0x79B9);
    device.files = vec![words(125, 0x0101), Vec::new(), words(10_000, 0x1F35)];
    device.custom = Some(0x41);
    device
});

/// Target `pdu`.
pub fn run(input: &[u8]) {
    let mut script = Script::new(input);
    let settings = script.byte();
    let framing = if settings & 1 == 0 {
        Framing::Rtu
    } else {
        Framing::ASCII
    };
    // The first function that is missing, and the distance to the next one.
    let (first, step) = (settings >> 1 & 7, usize::from(settings >> 4));
    let device = Device {
        lacks: match step {
            0 => Vec::new(),
            step => (first..0x30).step_by(step).collect(),
        },
        read_only_from: u32::from(script.byte()),
        ..DEVICE.clone()
    };
    let receiver = match framing {
        Framing::Rtu => Receiver::rtu(UNIT, false),
        Framing::Ascii { .. } => Receiver::ascii(UNIT, Width::Eight),
    };
    let mut adus = [Adu::new(), Adu::new()];
    let port = Port::new(receiver, &mut adus);
    let mut pair = Pair {
        reference: Server::new(delimiter(framing), device.clone()),
        unit: UnitOn::on(port, framing, Points(device)),
    };
    while let Some(tag) = script.tag() {
        pair.set_state(match tag >> 5 {
            0..=2 => None,
            3 => Some(0x0A),
            4 => Some(4),
            5 => Some(5),
            6 => Some(6),
            _ => Some(7),
        });
        let bytes = script.string();
        match tag & 3 {
            0 => pair.request(&[&[UNIT], bytes].concat()),
            1 => pair.request(&[&[0], bytes].concat()),
            2 => pair.request(bytes),
            _ => bytes.iter().for_each(|byte| pair.bad_frame(byte & 1 != 0)),
        }
    }
}

/// The unit and the reference, which receive the same requests.
struct Pair<'a> {
    unit: UnitOn<'a>,
    reference: Server,
}

impl Pair<'_> {
    fn set_state(&mut self, state: Option<u8>) {
        self.unit.points.state = state;
        self.reference.device.state = state;
    }

    fn bad_frame(&mut self, overrun: bool) {
        let faults = if overrun {
            Faults::OVERRUN
        } else {
            Faults::PARITY
        };
        self.unit.character(b':', Faults::NONE);
        self.unit.character(0, faults);
        assert_eq!(self.unit.silence(), None);
        self.reference.bad(overrun);
    }

    fn request(&mut self, bytes: &[u8]) {
        let [unit, pdu @ ..] = bytes else { return };
        let pdu = &pdu[..pdu.len().min(253)];
        let reply = self.unit.raw(&framed(self.reference.delimiter, *unit, pdu));
        let (delimiter, listening) = (self.reference.delimiter, self.reference.listening);
        let expected = if pdu.is_empty() {
            self.reference.bad(false);
            None
        } else {
            self.reference.good(*unit, pdu, false)
        };
        assert_eq!(reply, expected, "{bytes:02X?}");
        if let Some(reply) = reply {
            assert!(!listening && *unit == UNIT);
            // The frame of the reply must be valid.
            assert!(
                unframed(delimiter, &reply)[1..].len() <= 253,
                "{reply:02X?}"
            );
        }
        assert!(self.unit.points.0 == self.reference.device, "{bytes:02X?}");
        let server = &self.unit.server;
        assert_eq!(
            common::delimiter(server.framing()),
            self.reference.delimiter
        );
        assert_eq!(server.is_listen_only(), self.reference.listening);
        let counters = self.unit.counters().as_words();
        assert_eq!(counters, self.reference.counters, "{bytes:02X?}");
    }
}
