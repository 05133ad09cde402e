//! Packets of events, and where they come from.

use crate::Adu;

/// Kinds of events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// A coil has changed. The data is its value, one byte.
    Coil = 1,
    /// A discrete input has changed. The data is its value, one byte.
    DiscreteInput = 2,
    /// A holding register has changed. The data is its value, low byte first.
    HoldingRegister = 3,
    /// An input register has changed. The data is its value, low byte first.
    InputRegister = 4,
    /// The unit itself has started, without a value. The id is [`Kind::STARTED`].
    Unit = 0x0F,
    /// Edges were lost, because more waited than the unit has room for, without a value. The id is 0. The extension does
    /// not have this kind: a client passes over kinds that it does not know, but takes every event of kind
    /// [`Unit`](Self::Unit) for a start.
    Lost = 0x80,
}

impl Kind {
    /// Id of the event that the unit has started.
    pub const STARTED: u16 = 0;
}

/// What waits to be reported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Waiting {
    /// Number of events.
    pub count: u8,
    /// One of them has high priority.
    pub is_high: bool,
}

/// The part of a device that has events.
pub trait EventSource {
    /// Returns what waits.
    fn waiting(&self) -> Waiting;

    /// Returns whether the event "the unit has started" heads every packet: from the start until
    /// [`start_is_known`](Self::start_is_known), or until a master switches it off (sub-function 18, kind [`Kind::Unit`],
    /// id [`Kind::STARTED`]).
    fn reports_start(&self) -> bool;

    /// The master knows that the unit has started: two packets in a row that said so were confirmed. The first confirmation
    /// may be one from before the start, whose flag fits by chance.
    fn start_is_known(&mut self);

    /// Adds the oldest events to `packet`, until there is no more [room](Packet::push). They wait until
    /// [`sent`](Self::sent); the next call begins with them again.
    fn fill(&mut self, packet: &mut Packet);

    /// The packet that was filled last has been on the line: its events no longer wait.
    fn sent(&mut self);
}

/// Events that are reported together. Once they were on the line, they are sent again, without any change, until the
/// master confirms them. Before that the packet is made again for each fetch.
#[derive(Debug)]
pub struct Packet {
    bytes: [u8; Packet::CAPACITY],
    len: u8,
    /// Length that the events may have in all.
    room: u8,
    /// Number of events in the packet, and of those that waited when it was made.
    pub(super) number: u8,
    pub(super) flag: u8,
    pub(super) is_high: bool,
    /// The unit has won an arbitration with it. Before that no master can have it.
    pub(super) was_sent: bool,
    /// Its events no longer wait in the device.
    pub(super) was_taken: bool,
}

impl Packet {
    /// Largest length of the events of a packet, in bytes. Short packets let the events of other units through.
    pub const CAPACITY: usize = 64;

    pub(super) const fn new() -> Self {
        Self {
            bytes: [0; Self::CAPACITY],
            len: 0,
            room: 0,
            number: 0,
            flag: 0,
            is_high: false,
            was_sent: false,
            was_taken: false,
        }
    }

    /// Returns whether it holds no event.
    pub(super) const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns whether its first event is that the unit has started.
    pub(super) fn has_start(&self) -> bool {
        !self.is_empty() && self.bytes.get(1) == Some(&(Kind::Unit as u8))
    }

    /// Empties it, and allows at most `room` bytes.
    pub(super) fn clear(&mut self, room: u8) {
        self.len = 0;
        self.room = room.min(Self::CAPACITY as u8);
        self.number = 0;
        (self.was_sent, self.was_taken) = (false, false);
    }

    /// Adds an event with its value. Returns `false` and changes nothing when there is no room.
    pub fn push(&mut self, kind: Kind, id: u16, value: u16) -> bool {
        let ([high, low], [first, second]) = (id.to_be_bytes(), value.to_le_bytes());
        let len = match kind {
            Kind::Unit | Kind::Lost => 0,
            Kind::Coil | Kind::DiscreteInput => 1,
            Kind::HoldingRegister | Kind::InputRegister => 2,
        };
        let event = [len, kind as u8, high, low, first, second];
        let start = usize::from(self.len);
        let end = self.len + 4 + len;
        if end > self.room {
            return false;
        }
        let places = self.bytes.iter_mut().skip(start);
        for (place, byte) in places.zip(event) {
            *place = byte;
        }
        self.len = end;
        self.number = self.number.saturating_add(1);
        true
    }

    /// Appends flag, number of events, length and events. A packet without events has the flag of the one before, so that
    /// its confirmation is none of the next.
    pub(super) fn append_to(&self, adu: &mut Adu) {
        let flag = self.flag ^ u8::from(self.is_empty());
        adu.extend(&[flag, self.number, self.len]);
        adu.extend(self.bytes.get(..self.len.into()).unwrap_or_default());
    }
}
