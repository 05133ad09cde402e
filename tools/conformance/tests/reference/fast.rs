//! Fast Modbus, function 70, of the reference unit. It is alone on its line, so it wins every arbitration.

use std::time::Duration;

use conformance::endpoint::Received;
use modbus_line::fast::{ADDRESS, FUNCTION, kind};

use super::fault::Fault;
use super::unit::Unit;

/// The unit's serial number.
const SERIAL: u32 = 0x0D00_A53C;
/// Bits in front of the serial number of a unit that was not found yet, and of one that was.
const NOT_FOUND: u32 = 0b0110 << 28;
const FOUND: u32 = 0b1111 << 28;
/// Bits in front of the unit address: events of low priority, no events.
const EVENTS: u32 = 0b1001 << 8;
const NO_EVENTS: u32 = 0b1111 << 8;

/// The state of function 70.
#[derive(Default)]
pub struct Fast {
    is_found: bool,
    /// Types and addresses of points whose state is to be reported.
    due: Vec<(u8, u16)>,
    /// The packet that is not confirmed yet, after its sub-function.
    packet: Option<Vec<u8>>,
    flag: u8,
    /// The event that the unit has started is switched off.
    is_quiet: bool,
}

impl Unit {
    /// Serves a request of function 70 to all units.
    pub fn serve_all_units(&mut self, pdu: &[u8], at: Duration) {
        let head = [ADDRESS, FUNCTION];
        match *pdu {
            [FUNCTION, sub @ (1 | 2)] => {
                let is_lost = self.server.has(Fault::FoundAgain);
                self.fast.is_found &= sub == 2 && !is_lost;
                let serial = SERIAL.to_be_bytes();
                let (mark, reply) = if self.fast.is_found {
                    (FOUND, vec![4])
                } else {
                    (NOT_FOUND, [&[3], &serial[..], &[self.address]].concat())
                };
                self.fast.is_found = true;
                let at = self.arbitrate(mark | SERIAL & 0x0FFF_FFFF, 32, at);
                self.send(&[&head[..], &reply].concat(), at);
            }
            [FUNCTION, 8, a, b, c, d, ref inner @ ..] if !inner.is_empty() => {
                let serial = [a, b, c, d];
                let is_mine = serial == SERIAL.to_be_bytes();
                if !is_mine && !self.server.has(Fault::AnswersAnySerial) {
                    return;
                }
                let reply = if self.server.has(Fault::RefusesBySerial) {
                    Some(vec![inner[0] | 0x80, 1])
                } else {
                    self.server.request(&mut self.reference, false, inner)
                };
                if let Some(reply) = reply {
                    self.send(&[&head[..], &[9], &serial, &reply].concat(), at);
                }
            }
            [FUNCTION, 0x10, least, _, unit, flag] if least <= self.address => {
                if (unit, flag) == (self.address, self.fast.flag)
                    || self.server.has(Fault::ForgetsEvents)
                {
                    self.fast.packet = None;
                }
                self.make_packet();
                let address = u32::from(self.address);
                if let Some(packet) = self.fast.packet.clone() {
                    let at = self.arbitrate(EVENTS | address, 12, at);
                    self.send(&[&[self.address, FUNCTION, 0x11], &packet[..]].concat(), at);
                } else {
                    let at = self.arbitrate(NO_EVENTS | address, 12, at);
                    self.send(&[&head[..], &[0x12]].concat(), at);
                }
            }
            _ if self.server.has(Fault::AnswersUnknownToAll) => {
                self.send(&[ADDRESS, FUNCTION | 0x80, 1], at);
            }
            _ => {}
        }
    }

    /// Returns the reply to a request of function 70 to the unit's own address.
    pub fn settings(&mut self, pdu: &[u8]) -> Vec<u8> {
        let refuse = |code| vec![FUNCTION | 0x80, code];
        let [FUNCTION, 0x18, rest @ ..] = pdu else {
            return if self.server.has(Fault::EchoesUnknownFast) {
                pdu.to_vec()
            } else {
                refuse(1)
            };
        };
        let lenient = self.server.has(Fault::IgnoresSettingsLength);
        let Some((length, mut ranges)) = rest.split_first() else {
            return refuse(3);
        };
        if usize::from(*length) != ranges.len() && !lenient {
            return refuse(3);
        }
        let mut masks = Vec::new();
        while !ranges.is_empty() {
            // The suite sends ranges of one point only.
            let [kind, high, low, 1, setting, after @ ..] = ranges else {
                return if lenient { pdu.to_vec() } else { refuse(3) };
            };
            masks.push(u8::from(
                self.set((*kind, u16::from_be_bytes([*high, *low])), *setting),
            ));
            ranges = after;
        }
        [&[FUNCTION, 0x18, masks.len() as u8], &masks[..]].concat()
    }

    /// Switches the events of a point on or off. Returns whether they are on.
    fn set(&mut self, point: (u8, u16), setting: u8) -> bool {
        self.fast.due.retain(|due| *due != point);
        if point == (kind::UNIT, 0) {
            self.fast.is_quiet = setting == 0;
            return setting != 0;
        }
        // The reference has coils and registers at many addresses; any may report events.
        let is_on = setting != 0 && point.0 == kind::COIL;
        self.fast.due.extend(is_on.then_some(point));
        is_on
    }

    /// Moves the events into a packet, unless the packet before is not confirmed.
    fn make_packet(&mut self) {
        let fast = &mut self.fast;
        if fast.packet.is_some() || fast.due.is_empty() && fast.is_quiet {
            return;
        }
        let mut events = Vec::new();
        if !fast.is_quiet {
            events.extend([0, kind::UNIT, 0, 0]);
        }
        let count = fast.due.len() as u8 + u8::from(!fast.is_quiet);
        for (kind, id) in fast.due.drain(..) {
            let [high, low] = id.to_be_bytes();
            events.extend([1, kind, high, low, 0]);
        }
        fast.flag ^= 1;
        let head = [fast.flag, count, events.len() as u8];
        fast.packet = Some([&head[..], &events].concat());
    }

    /// Sends the bits of a value, the highest first. Returns the end of the arbitration.
    fn arbitrate(&mut self, value: u32, count: u32, at: Duration) -> Duration {
        let window = self
            .line
            .bits(13)
            .max(self.line.bits(12) + Duration::from_micros(50));
        let character = self.line.characters(1);
        for n in 0..count {
            if value >> (count - 1 - n) & 1 == 0 {
                let start = at + window * n;
                self.edges.push((start, true));
                self.edges.push((start + character, false));
                self.sent.push_back(Received {
                    byte: 0xFF,
                    start,
                    end: start + character,
                    good: true,
                });
            }
        }
        at + window * count
    }
}
