//! A unit's part in scans and in the reports of events.

use super::{ADDRESS, EventSource, FUNCTION, Kind, Packet, SERIAL_AHEAD, Waiting, sub};
use crate::line::Ending;
use crate::server::refuse;
use crate::{Adu, Exception, Function, Outcome, Reply, Request, Server};

/// Bits in front of the serial number of a unit that was not found yet, and of one that was.
const NOT_FOUND: u32 = 0b0110 << 28;
const FOUND: u32 = 0b1111 << 28;
/// Bits in front of the unit address: events of high and low priority, events of a unit that lets others go first, no
/// events.
const HIGH: u32 = 0b1000 << 8;
const LOW: u32 = 0b1001 << 8;
const YIELDING: u32 = 0b1110 << 8;
const NO_EVENTS: u32 = 0b1111 << 8;
/// Number of bits of the unit address, behind the priority.
const ADDRESS_BITS: u8 = 8;
/// Number of packets in a row after which others go first.
const IN_A_ROW: u8 = 2;
/// Number of packets in a row after which a unit reports once that there are no events, if the request starts at its
/// address. Some masters begin again with the lowest address only when they receive that report.
const BEFORE_NONE: u8 = 4;
/// Number of confirmed packets in a row that contain the event *start*. After them the master knows of the start.
const STARTS: u8 = 2;
/// Largest number of words that function 17 can return inside sub-function 09: 256 bytes less 7 in front, 2 of function
/// and byte count, and 2 of the CRC are 245.
const MAX_WORDS: u16 = 122;

/// What a unit takes part in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Scans, requests by serial number, and events.
    Everything,
    /// Scans and requests by serial number: the unit has no unit address.
    NoEvents,
    /// Scans only.
    Scans,
    /// Requests by serial number only: the unit's clock is not accurate enough to arbitrate.
    Requests,
}

/// A unit of Fast Modbus: its serial number, whether it was found, and the events that were reported last.
#[derive(Debug)]
pub struct Unit {
    serial: u32,
    address: u8,
    part: Part,
    is_found: bool,
    /// Number of packets that were sent in a row, since others went first.
    in_a_row: u8,
    /// Number of packets that were sent in a row, since there were no events.
    since_none: u8,
    /// Number of packets with the start that were confirmed in a row.
    starts: u8,
    packet: Packet,
    /// What winning the last arbitration means for this unit.
    contended: Contended,
}

/// What the unit arbitrated for last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Contended {
    Nothing,
    ToBeFound,
    Packet,
}

/// The bits with which a reply takes part in an arbitration, for [`Port::arbitrate`](crate::line::Port::arbitrate).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Contest {
    /// The value, in the lowest bits.
    pub value: u32,
    /// Number of bits, each of which has a window: 0 to 32.
    pub windows: u8,
}

impl Unit {
    /// Creates a unit that has just started, with its unit address, or 0 for a unit without one.
    #[must_use]
    pub const fn new(serial: u32, address: u8, part: Part) -> Self {
        Self {
            serial,
            address,
            part,
            is_found: false,
            in_a_row: 0,
            since_none: 0,
            starts: 0,
            packet: Packet::new(),
            contended: Contended::Nothing,
        }
    }

    /// Sets the unit address, which has changed.
    pub const fn set_address(&mut self, address: u8) {
        self.address = address;
    }

    /// Opens a request to [`ADDRESS`] if it is for this unit alone, by its serial number: it is the request inside then, to
    /// be served by [`Server::serve`]. [`close`](Self::close) its reply.
    #[must_use]
    pub fn open(&mut self, request: &mut Request<'_>) -> bool {
        self.end_contest(request.ending);
        let adu = &mut *request.adu;
        let is_for_unit = adu.get(1) == FUNCTION
            && adu.get(2) == sub::REQUEST
            && adu.len() > 7
            && adu.from(3).starts_with(&self.serial.to_be_bytes())
            && self.part != Part::Scans;
        if !is_for_unit {
            return false;
        }
        adu.drop_front(SERIAL_AHEAD);
        // Not the address of a broadcast, also for a unit without an address.
        adu.set(0, ADDRESS);
        // What is not served in this way becomes a request that the server refuses with the right exception.
        let code = adu.get(1);
        if code == Function::Diagnostics.code() || code == FUNCTION {
            // No such sub-function: 01.
            adu.set(2, 0xFF);
        } else if code == Function::ReadWriteMultipleRegisters.code()
            && u16::from_be_bytes([adu.get(4), adu.get(5)]) > MAX_WORDS
        {
            // No such quantity: 03. Later it would have written already.
            adu.set(4, 0xFF);
        }
        true
    }

    /// Makes the reply to a request that was [opened](Self::open) one of this unit's serial number.
    pub fn close(&self, reply: &mut Reply<'_>) {
        let adu = &mut *reply.adu;
        if !adu.add_front(SERIAL_AHEAD) {
            // Only the reply to a read can be too long: all other replies are no longer than their requests.
            reply.outcome = refuse(adu, Exception::IllegalDataValue.into());
            adu.add_front(SERIAL_AHEAD);
        }
        let head = [ADDRESS, FUNCTION, sub::REPLY].into_iter();
        for (at, byte) in (0..).zip(head.chain(self.serial.to_be_bytes())) {
            adu.set(at, byte);
        }
    }

    /// Notes how the unit's last arbitration has ended.
    ///
    /// A unit that lets others go first does so until it wins, or until it loses to a unit that also lets others go first;
    /// the addresses decide between these two. No other unit has events then. So each of several units with a steady flow
    /// of events has its turn.
    fn end_contest(&mut self, ending: Ending) {
        let contended = core::mem::replace(&mut self.contended, Contended::Nothing);
        let yields = self.in_a_row >= IN_A_ROW;
        match (contended, ending) {
            (Contended::ToBeFound, Ending::Won) => self.is_found = true,
            (Contended::Packet, Ending::Won) => {
                // A packet that had no room for any event is made again.
                self.packet.was_sent = !self.packet.is_empty();
                self.since_none = self.since_none.saturating_add(1);
                self.in_a_row = if yields { 1 } else { self.in_a_row + 1 };
            }
            (Contended::Packet, Ending::Lost(left)) => {
                self.since_none = 0;
                if !yields || left < ADDRESS_BITS {
                    self.in_a_row = 0;
                }
            }
            _ => {}
        }
    }

    /// Replaces a request to start or to continue a scan with the reply.
    fn scan(&mut self, adu: &mut Adu) -> Contest {
        let mark = if self.is_found {
            adu.set(2, sub::NONE_LEFT);
            FOUND
        } else {
            adu.set(2, sub::FOUND);
            adu.extend(&self.serial.to_be_bytes());
            adu.extend(&[self.address]);
            self.contended = Contended::ToBeFound;
            NOT_FOUND
        };
        Contest {
            value: mark | self.serial & 0x0FFF_FFFF,
            windows: 32,
        }
    }

    /// Replaces a request for events with the reply. Returns `None` if the request excludes this unit's address.
    fn fetch(&mut self, adu: &mut Adu, source: &mut impl EventSource) -> Option<Contest> {
        let (least, room, confirmed, flag) = (adu.get(3), adu.get(4), adu.get(5), adu.get(6));
        if self.packet.was_sent && !self.packet.was_taken {
            source.sent();
            self.packet.was_taken = true;
        }
        if confirmed == self.address && flag == self.packet.flag && self.packet.was_sent {
            self.confirm(source);
        }
        if self.address < least {
            return None;
        }
        adu.truncate(2);
        let waiting = source.waiting();
        let has_events = waiting.count > 0 || source.reports_start() || self.packet.was_sent;
        let others_wait = least == self.address && self.since_none >= BEFORE_NONE;
        if !has_events || others_wait {
            adu.extend(&[sub::NO_EVENTS]);
            self.since_none = 0;
            if !has_events {
                self.in_a_row = 0;
            }
            return Some(self.contest(NO_EVENTS));
        }
        let is_high = waiting.is_high || self.packet.is_high && self.packet.was_sent;
        if !self.packet.was_sent {
            self.make_packet(room, waiting, source);
        }
        adu.set(0, self.address);
        adu.extend(&[sub::EVENTS]);
        self.packet.append_to(adu);
        self.contended = Contended::Packet;
        let priority = if self.in_a_row >= IN_A_ROW {
            YIELDING
        } else if is_high {
            HIGH
        } else {
            LOW
        };
        Some(self.contest(priority))
    }

    /// Makes the packet, with this room, from what waits now.
    fn make_packet(&mut self, room: u8, waiting: Waiting, source: &mut impl EventSource) {
        self.packet.clear(room);
        self.packet.is_high = waiting.is_high;
        if source.reports_start() {
            self.packet.push(Kind::Unit, Kind::STARTED, 0);
        }
        let own = self.packet.number;
        source.fill(&mut self.packet);
        // More events wait now if edges were lost.
        self.packet.number = own.saturating_add(source.waiting().count);
    }

    /// Clears the packet, which the master has confirmed.
    fn confirm(&mut self, source: &mut impl EventSource) {
        self.starts = if self.packet.has_start() {
            self.starts + 1
        } else {
            0
        };
        if self.starts == STARTS {
            self.starts = 0;
            source.start_is_known();
        }
        self.packet.clear(0);
        self.packet.flag ^= 1;
    }

    fn contest(&self, priority: u32) -> Contest {
        Contest {
            value: priority | u32::from(self.address),
            windows: 12,
        }
    }
}

impl Server {
    /// Serves a request to [`ADDRESS`] for which [`Unit::open`] has returned false, from the line of `unit`. The reply is
    /// written to the buffer of the request. Returns the reply, and the bits with which the unit sends it in the arbitration.
    ///
    /// A request gets no reply when the unit does not know it, or when [`Part`] excludes the unit from it.
    pub fn serve_fast<'a, M: EventSource>(
        &mut self,
        request: Request<'a>,
        unit: &mut Unit,
        model: &mut M,
    ) -> (Reply<'a>, Contest) {
        unit.end_contest(request.ending);
        let adu = &mut *request.adu;
        let arbitrates = unit.part != Part::Requests;
        let mut outcome = Outcome::NoEffect;
        let is_fast = adu.get(1) == FUNCTION;
        let contest = match (adu.get(2), adu.len()) {
            _ if self.is_listen_only() => {
                outcome = Outcome::NotObeyed;
                None
            }
            (sub::START_SCAN, 3) if is_fast => {
                unit.is_found = false;
                arbitrates.then(|| unit.scan(adu))
            }
            (sub::CONTINUE_SCAN, 3) if is_fast => arbitrates.then(|| unit.scan(adu)),
            (sub::FETCH, 7) if is_fast => {
                let takes_part = unit.part == Part::Everything;
                takes_part.then(|| unit.fetch(adu, model)).flatten()
            }
            _ => {
                outcome = Outcome::NoRequest;
                None
            }
        };
        let reply = Reply {
            adu: request.adu,
            is_answered: contest.is_some(),
            framing: self.framing(),
            outcome,
            writes: false,
        };
        (reply, contest.unwrap_or_default())
    }
}
