//! A packet on the air.

use super::{Parameters, timing};
use f103::corner::Corner;
use f103::time::Time;

/// The transmitter of a packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sender {
    /// The module of a board, by the number of the board on its bus, from 0.
    Board(u16),
    /// The gateway radio.
    Gateway,
    /// Another transmitter: [`Air::transmit`](super::Air::transmit).
    Other,
}

impl Sender {
    /// Returns a number that no other sender has.
    pub(super) const fn code(self) -> u64 {
        match self {
            Self::Board(n) => n as u64,
            Self::Gateway => 0x1_0000,
            Self::Other => 0x1_0001,
        }
    }
}

/// A packet on the air.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packet {
    /// The transmitter.
    pub sender: Sender,
    /// Number of the packet, from 1, of those of this transmitter.
    pub number: u64,
    /// Start of the preamble.
    pub start: Time,
    /// End of the last bit.
    pub end: Time,
    /// The transmitter's parameters: its channel, air rate, FEC and address.
    pub parameters: Parameters,
    /// Duration of the wake-up preamble, which is a part of the packet; zero without one.
    pub wake_up: Time,
    /// The bytes, at most 58.
    pub bytes: Vec<u8>,
}

impl Packet {
    /// Returns a packet that begins at `start`, at a corner of the transmitter.
    pub(super) fn new(
        corner: Corner,
        sender: Sender,
        number: u64,
        start: Time,
        parameters: Parameters,
        wake_up: Time,
        bytes: Vec<u8>,
    ) -> Self {
        let end = start + wake_up + timing::packet(bytes.len(), parameters.air_rate(), corner);
        Self {
            sender,
            number,
            start,
            end,
            parameters,
            wake_up,
            bytes,
        }
    }

    /// Returns whether this is packet `number` of `sender`.
    pub(super) fn is(&self, sender: Sender, number: u64) -> bool {
        self.sender == sender && self.number == number
    }

    /// Returns whether both packets are on the same channel at the same time, so that they destroy each other.
    #[must_use]
    pub fn collides_with(&self, other: &Self) -> bool {
        !self.is(other.sender, other.number)
            && self.parameters.channel() == other.parameters.channel()
            && self.start < other.end
            && other.start < self.end
    }
}

/// What the rest of the air has to know about a module.
#[derive(Clone, Debug)]
pub(crate) enum News {
    /// The module has begun to send a packet.
    Begun(Packet),
    /// The module has lost its power, so its packet with this number ended at this instant.
    Cut(Sender, u64, Time),
    /// The module has entered normal mode at this instant, with these parameters.
    Tuned(Time, Parameters),
}
