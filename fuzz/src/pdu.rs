//! Target `pdu`: requests of any content through one server, one after another, in RTU or ASCII mode.
//!
//! Reply, points, counters and modes are those of the reference that modbus-server's tests have: so the
//! CRC or LRC is right, an exception has its form, what is refused changes nothing, and a broadcast is
//! never answered.
//!
//! ```text
//!   script: settings (1: ASCII, the rest: which functions are missing), first read-only point, requests
//!   request: tag, length, bytes
//!     tag & 3:  0 a PDU to this unit  1 to all  2 unit and PDU as they come  3 so many bad frames
//!     tag >> 5: the exception that the device's state calls for, from then on; 0 to 2: none
//! ```

use std::sync::LazyLock;

use modbus_server::line::Framing;
use modbus_server::{Adu, Exception, LineCounters, Outcome, Server};

use crate::common::reference::Reference;
use crate::common::{Points, UNIT, unframed};
use crate::script::Script;
use crate::serving::serve;

/// More bits than one write may hold, more words than one read may ask for, and ends within reach.
static POINTS: LazyLock<Points> = LazyLock::new(|| {
    let mut points = Points::new(0, 0);
    // Each table has other values, and other ends.
    let bits = |count: u32, most| (0..count).map(move |n| n * n % 7 < most).collect();
    let words = |count: u16, by| (0..count).map(move |n| n.wrapping_mul(by)).collect();
    points.bits = bits(2010, 3);
    points.input_bits = bits(2005, 2);
    points.words = words(130, 0x9E37);
    points.input_words = words(127, 0x79B9);
    points.custom = Some(0x41);
    points
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
    // The first function that is missing, and how many codes lie between it and the next.
    let (first, step) = (settings >> 1 & 7, usize::from(settings >> 4));
    let points = Points {
        lacks: match step {
            0 => Vec::new(),
            step => (first..0x30).step_by(step).collect(),
        },
        read_only_from: u32::from(script.byte()),
        ..POINTS.clone()
    };
    let server = Server::new(UNIT, framing);
    let mut unit = Unit {
        server: if points.lacks.contains(&0x08) {
            server.without_listen_only()
        } else {
            server
        },
        reference: Reference::new(framing, points.clone()),
        line: LineCounters::ZERO,
        points,
    };
    while let Some(tag) = script.tag() {
        unit.set_state(match tag >> 5 {
            0..=2 => None,
            3 => Some(Exception::GatewayPathUnavailable),
            4 => Some(Exception::ServerDeviceFailure),
            5 => Some(Exception::Acknowledge),
            6 => Some(Exception::ServerDeviceBusy),
            _ => Some(Exception::NegativeAcknowledge),
        });
        let bytes = script.string();
        match tag & 3 {
            0 => unit.request(&[&[UNIT], bytes].concat()),
            1 => unit.request(&[&[0], bytes].concat()),
            2 => unit.request(bytes),
            _ => bytes.iter().for_each(|byte| unit.bad_frame(byte & 1 != 0)),
        }
    }
}

/// The server and the reference, side by side.
struct Unit {
    server: Server,
    points: Points,
    line: LineCounters,
    reference: Reference,
}

impl Unit {
    fn set_state(&mut self, state: Option<Exception>) {
        self.points.state = state;
        self.reference.points.state = state;
    }

    fn bad_frame(&mut self, overrun: bool) {
        self.line.communication_errors += 1;
        self.line.overruns += u16::from(overrun);
        self.reference.bad(overrun);
    }

    fn request(&mut self, bytes: &[u8]) {
        let mut adu = Adu::new();
        let kept = bytes.iter().take_while(|byte| adu.push(**byte)).count();
        assert_eq!(kept, bytes.len().min(Adu::CAPACITY));
        let (framing, listening) = (self.server.framing(), self.reference.listening);
        let [unit, pdu @ ..] = &bytes[..kept] else {
            return self.is_nothing(&adu);
        };
        if pdu.is_empty() {
            return self.is_nothing(&adu);
        }
        self.line.bus_messages += 1;
        if ![UNIT, 0].contains(unit) {
            // A receiver counts it and keeps it to itself.
            assert!(self.reference.good(*unit, pdu, false).is_none());
            return self.is_nothing(&adu);
        }
        let reply = serve(&mut self.server, &mut self.points, &self.line, &mut adu);
        let expected = self.reference.good(*unit, pdu, false);
        assert_eq!(reply, expected, "{bytes:02X?}");
        if let Some(reply) = reply {
            assert!(!listening && *unit == UNIT);
            // Its check is right, and it comes apart as it was put together.
            let most = pdu.len().max(253);
            assert!(unframed(framing, &reply)[1..].len() <= most, "{reply:02X?}");
        }
        assert!(self.points == self.reference.points, "{bytes:02X?}");
        assert_eq!(self.server.framing(), self.reference.framing);
        assert_eq!(self.server.is_listen_only(), self.reference.listening);
        let counters = self.server.counters_at(&self.line).as_words();
        assert_eq!(counters, self.reference.counters, "{bytes:02X?}");
    }

    /// Another unit's, or no request at all.
    fn is_nothing(&mut self, adu: &Adu) {
        assert!(!self.server.answers(adu));
        let decision = self.server.decide(adu, &self.points);
        assert_eq!(decision.outcome, Outcome::NotForUs);
        assert!(decision.reply.is_none());
    }
}
