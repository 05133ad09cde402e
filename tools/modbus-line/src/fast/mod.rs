//! Fast Modbus, function 70: finding units, requests by serial number, and events, for a master on an RTU line.
//!
//! This is Wiren Board's open extension (`docs/protocol.en.md` in the repository wirenboard/wb-modbus-ext-scanner).
//! Units that want to reply to the same request decide by an arbitration which of them does. A unit that sends a bit
//! of the arbitration sends the byte FF, so a master ignores what is in front of a reply. [`Scan`] and [`Fetcher`] decide
//! what to send next; sending, waiting and receiving are the caller's.
//!
//! ```
//! use modbus_line::adu::Framing;
//! use modbus_line::fast::{ADDRESS, Reply, Request};
//!
//! let request = Request::StartScan;
//! let frame = Framing::Rtu.frame(0, ADDRESS, &request.pdu());
//! assert_eq!(frame, [0xFD, 0x46, 0x01, 0x13, 0x90]);
//! let reply = [0xFF, 0xFF, 0xFD, 0x46, 0x04, 0xD3, 0x93];
//! assert_eq!(request.find(&reply), Some((Reply::NoneLeft, 2..7)));
//! ```

mod codes;
mod fetch;
mod scan;
mod settings;
mod words;

use std::ops::Range;
use std::time::Duration;

use crate::LineFormat;
use crate::adu::{Framing, RTU_MOST, response_length};

pub use codes::{kind, sub};
pub use fetch::Fetcher;
pub use scan::{Heard, Scan};
pub use settings::{Priority, Setting, are_on, settings};
pub(crate) use words::{carried, words};

/// Unit address of requests to all units.
pub const ADDRESS: u8 = 0xFD;
/// Function code.
pub const FUNCTION: u8 = 0x46;

/// A request to all units.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Request {
    /// All units count as not found; the one with the lowest serial number replies.
    StartScan,
    /// The unit with the lowest serial number of those that were not found yet replies.
    ContinueScan,
    /// A usual request to the unit with this serial number.
    BySerial {
        /// The serial number.
        serial: u32,
        /// The PDU of the request.
        pdu: Vec<u8>,
    },
    /// A unit that has events replies.
    Fetch {
        /// Only units with this address or a higher one reply.
        least: u8,
        /// Most bytes of events in the reply.
        room: u8,
        /// Unit address and flag of the packet that was received last.
        confirmed: Option<(u8, u8)>,
    },
}

/// The reply of a unit to a [`Request`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// A unit that was not found before.
    Found {
        /// Its serial number.
        serial: u32,
        /// Its unit address.
        unit: u8,
    },
    /// All units are found.
    NoneLeft,
    /// The PDU of the reply to a request by serial number.
    Pdu(Vec<u8>),
    /// A unit has events.
    Events(Packet),
    /// No unit has events.
    NoEvents,
}

/// Events that a unit reports together, until the master confirms them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packet {
    /// Address of the unit.
    pub unit: u8,
    /// Flag to confirm. It differs from that of the unit's packet before.
    pub flag: u8,
    /// Number of events that the unit has, including those of the packet.
    pub waiting: u8,
    /// The events, oldest first.
    pub events: Vec<Event>,
}

/// A change that a unit reports.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// Type, one of [`kind`] or an unknown one.
    pub kind: u8,
    /// Address of the point, or the number of the event of a unit.
    pub id: u16,
    /// The new value, low byte first.
    pub data: Vec<u8>,
}

impl Request {
    /// Returns the PDU of the request, which is sent to [`ADDRESS`].
    #[must_use]
    pub fn pdu(&self) -> Vec<u8> {
        let mut bytes = vec![FUNCTION];
        match self {
            Self::StartScan => bytes.push(sub::START_SCAN),
            Self::ContinueScan => bytes.push(sub::CONTINUE_SCAN),
            Self::BySerial { serial, pdu } => {
                bytes.push(sub::REQUEST);
                bytes.extend(serial.to_be_bytes());
                bytes.extend(pdu);
            }
            Self::Fetch {
                least,
                room,
                confirmed,
            } => {
                let (unit, flag) = confirmed.unwrap_or_default();
                bytes.extend([sub::FETCH, *least, *room, unit, flag]);
            }
        }
        bytes
    }

    /// Returns the longest times from the end of the request to the first byte of an arbitration or reply, and to the
    /// end of the reply. A request by serial number has no arbitration, and its unit may take longer.
    #[must_use]
    pub fn longest_wait(&self, line: LineFormat) -> (Duration, Duration) {
        // Unit addresses of up to 247 have a 0 in the first nine windows: four of priority, and five.
        let (to_first, all, reply) = match self {
            Self::StartScan | Self::ContinueScan => (33, 33, 10),
            Self::BySerial { .. } => (0, 0, RTU_MOST),
            Self::Fetch { room, .. } => (9, 13, 8 + usize::from(*room)),
        };
        let start = line.bits(20) + Duration::from_micros(800);
        let windows = |count| start + line.bits(count * window_bits(line.baud));
        // Windows and gaps count characters of 11 bits, whatever the format.
        (
            windows(to_first),
            windows(all) + line.bits(11 * reply as u64),
        )
    }

    /// Returns the reply in received bytes and where it is. Ignores what is in front of it: bytes of the arbitration,
    /// damaged ones, and the request itself, which some adapters return.
    #[must_use]
    pub fn find(&self, bytes: &[u8]) -> Option<(Reply, Range<usize>)> {
        (0..bytes.len()).find_map(|start| {
            let rest = bytes.get(start..)?;
            let length = self.reply_length(rest)?;
            let (unit, pdu) = Framing::Rtu.open(rest.get(..length)?)?;
            Some((self.reply(unit, &pdu)?, start..start + length))
        })
    }

    /// Returns the length of the reply that begins with these bytes.
    fn reply_length(&self, bytes: &[u8]) -> Option<usize> {
        let [_, FUNCTION, sub, ..] = bytes else {
            return None;
        };
        match (self, *sub) {
            (Self::StartScan | Self::ContinueScan, sub::FOUND) => Some(10),
            (Self::StartScan | Self::ContinueScan, sub::NONE_LEFT) => Some(5),
            (Self::BySerial { pdu, .. }, sub::REPLY) => {
                // The last byte of the serial number stands for the unit address of a usual frame.
                Some(6 + response_length(pdu, bytes.get(6..)?)?)
            }
            (Self::Fetch { .. }, sub::EVENTS) => Some(8 + usize::from(*bytes.get(5)?)),
            (Self::Fetch { .. }, sub::NO_EVENTS) => Some(5),
            _ => None,
        }
    }

    /// Returns the reply with this address and PDU.
    fn reply(&self, unit: u8, pdu: &[u8]) -> Option<Reply> {
        let data = pdu.get(2..)?;
        if pdu.get(1) == Some(&sub::EVENTS) {
            return Packet::of(unit, data).map(Reply::Events);
        }
        if unit != ADDRESS {
            return None;
        }
        match (self, data) {
            (Self::BySerial { serial, .. }, data) => {
                let (of, pdu) = data.split_first_chunk()?;
                (u32::from_be_bytes(*of) == *serial).then(|| Reply::Pdu(pdu.to_vec()))
            }
            (Self::Fetch { .. }, _) => Some(Reply::NoEvents),
            (_, [a, b, c, d, unit]) => Some(Reply::Found {
                serial: u32::from_be_bytes([*a, *b, *c, *d]),
                unit: *unit,
            }),
            _ => Some(Reply::NoneLeft),
        }
    }
}

impl Packet {
    /// Returns the packet with these bytes after the sub-function; `None` if they are not whole events.
    fn of(unit: u8, bytes: &[u8]) -> Option<Self> {
        let [flag, waiting, _, events @ ..] = bytes else {
            return None;
        };
        let mut rest = events;
        let mut events = Vec::new();
        while let [length, kind, high, low, after @ ..] = rest {
            let (data, after) = after.split_at_checked((*length).into())?;
            events.push(Event {
                kind: *kind,
                id: u16::from_be_bytes([*high, *low]),
                data: data.to_vec(),
            });
            rest = after;
        }
        rest.is_empty().then_some(Self {
            unit,
            flag: *flag,
            waiting: *waiting,
            events,
        })
    }
}

/// Returns the length of a window of an arbitration in bits: 13, or 12 and 50 us if that is more.
fn window_bits(baud: u32) -> u64 {
    (12 + (50 * u64::from(baud)).div_ceil(1_000_000)).max(13)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SERIAL: u32 = 0x0001_EB37;

    fn frame(unit: u8, pdu: &[u8]) -> Vec<u8> {
        Framing::Rtu.frame(0, unit, pdu)
    }

    fn by_serial() -> Request {
        Request::BySerial {
            serial: SERIAL,
            pdu: vec![3, 0, 0xC8, 0, 0x14],
        }
    }

    fn fetch(confirmed: Option<(u8, u8)>) -> Request {
        Request::Fetch {
            least: 0,
            room: 100,
            confirmed,
        }
    }

    #[test]
    fn requests_are_the_examples_of_the_document() {
        for (request, bytes) in [
            (Request::StartScan, &[0xFD, 0x46, 1, 0x13, 0x90][..]),
            (Request::ContinueScan, &[0xFD, 0x46, 2, 0x53, 0x91]),
            (
                by_serial(),
                &[
                    0xFD, 0x46, 8, 0, 1, 0xEB, 0x37, 3, 0, 0xC8, 0, 0x14, 0x5B, 7,
                ],
            ),
        ] {
            assert_eq!(frame(ADDRESS, &request.pdu()), bytes);
        }
        // The document leaves the CRC of this example open.
        let confirms = fetch(Some((0x0A, 1))).pdu();
        assert_eq!(confirms, [0x46, 0x10, 0, 0x64, 0x0A, 1]);
        assert_eq!(fetch(None).pdu(), [0x46, 0x10, 0, 0x64, 0, 0]);
    }

    #[test]
    fn replies_of_the_document_are_found_behind_an_arbitration_once_they_are_whole() {
        let mut name = vec![0xFD, 0x46, 9, 0, 1, 0xEB, 0x37, 3, 0x28];
        for letter in *b"WBMSW4" {
            name.extend([0, letter]);
        }
        name.extend([0; 28]);
        name.extend([0x30, 0x4F]);
        let found = [0xFD, 0x46, 3, 0, 1, 0xEB, 0x37, 0x0C, 0xCE, 0xDC];
        let events = frame(5, &[0x46, 0x11, 1, 1, 6, 2, 4, 1, 0xD0, 4, 0]);
        let packet = Packet {
            unit: 5,
            flag: 1,
            waiting: 1,
            events: vec![Event {
                kind: kind::INPUT_REGISTER,
                id: 0x01D0,
                data: vec![4, 0],
            }],
        };
        let of_name = name[7..name.len() - 2].to_vec();
        for (request, reply, wanted) in [
            (
                Request::ContinueScan,
                &found[..],
                Reply::Found {
                    serial: SERIAL,
                    unit: 0x0C,
                },
            ),
            (
                Request::StartScan,
                &[0xFD, 0x46, 4, 0xD3, 0x93],
                Reply::NoneLeft,
            ),
            (by_serial(), &name, Reply::Pdu(of_name)),
            (fetch(None), &events, Reply::Events(packet)),
            (
                fetch(None),
                &[0xFD, 0x46, 0x12, 0x52, 0x5D],
                Reply::NoEvents,
            ),
        ] {
            // The request, as an adapter may return it, and an arbitration with a damaged byte.
            let own = frame(ADDRESS, &request.pdu());
            let received = [&own[..], &[0xFF, 0xFD, 0xFF, 0xFF], reply].concat();
            for length in 0..received.len() {
                assert_eq!(request.find(&received[..length]), None, "{request:?}");
            }
            let at = received.len() - reply.len()..received.len();
            assert_eq!(request.find(&received), Some((wanted, at)));
        }
    }

    #[test]
    fn frame_of_another_request_is_not_found() {
        let other = frame(ADDRESS, &[0x46, 9, 0, 1, 0xEB, 0x38, 0x83, 2]);
        assert_eq!(by_serial().find(&other), None, "another serial number");
        let refused = frame(ADDRESS, &[0x46, 9, 0, 1, 0xEB, 0x37, 0x83, 2]);
        let (reply, _) = by_serial().find(&refused).unwrap();
        assert_eq!(reply, Reply::Pdu(vec![0x83, 2]));
        let none_left = frame(ADDRESS, &[0x46, 4]);
        assert_eq!(fetch(None).find(&none_left), None);
        let of_unit = frame(7, &[0x46, 4]);
        assert_eq!(Request::StartScan.find(&of_unit), None);
        // An event that is longer than the packet.
        let broken = frame(5, &[0x46, 0x11, 1, 1, 5, 9, 4, 1, 0xD0, 4]);
        assert_eq!(fetch(None).find(&broken), None);
    }

    #[test]
    fn windows_have_13_bits_and_more_where_a_bit_is_short() {
        // The document computes 3 bits at 57600 bit/s.
        assert_eq!([9600, 57_600, 921_600].map(window_bits), [13, 15, 59]);
        let line = LineFormat::default();
        let (first, last) = Request::StartScan.longest_wait(line);
        assert_eq!(first, line.bits(20 + 33 * 13) + Duration::from_micros(800));
        assert_eq!((last - first).as_millis(), line.bits(110).as_millis());
        let (first, last) = fetch(None).longest_wait(line);
        assert!(first < last && first < Duration::from_millis(16));
    }
}
