//! What the server has decided about a request.

use crate::{Exception, Function, Span};

/// The answer to a request, settled but not yet carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decision {
    /// The first bytes of the reply; they may go out at once. `None`: silence.
    pub reply: Option<Head>,
    /// What is left to do, by [`Server::carry_out`](crate::Server::carry_out).
    pub work: Work,
    /// How the request fared, for the counters.
    pub outcome: Outcome,
}

impl Decision {
    /// Neither reply nor work.
    pub(crate) const fn silence(outcome: Outcome) -> Self {
        Self {
            reply: None,
            work: Work::None,
            outcome,
        }
    }
}

/// The start of a reply: all of it for an exception or the echo of a write, unit, function and byte
/// count for a read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Head {
    bytes: [u8; Head::CAPACITY],
    len: u8,
    body: u8,
}

impl Head {
    /// The longest reply that needs no body: unit and PDU of a mask write (V1.1b3 6.16).
    const CAPACITY: usize = 8;

    /// No reply.
    pub(crate) const EMPTY: Self = Self {
        bytes: [0; Self::CAPACITY],
        len: 0,
        body: 0,
    };

    /// How many bytes, without CRC.
    #[inline]
    pub(crate) const fn len(&self) -> u8 {
        self.len
    }

    /// One byte; 0 beyond the end.
    #[inline]
    pub(crate) fn get(&self, index: u16) -> u8 {
        self.bytes.get(usize::from(index)).copied().unwrap_or(0)
    }

    /// The bytes of the head, without CRC.
    #[inline]
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.len)).unwrap_or_default()
    }

    /// How many bytes the transmitter must be handed as the body; 0: the head is the whole reply.
    #[inline]
    pub const fn body_len(&self) -> u8 {
        self.body
    }

    /// The reply to a read of `body` bytes.
    #[inline]
    pub(crate) const fn read(unit: u8, function: u8, body: u8) -> Self {
        Self {
            bytes: [unit, function, body, 0, 0, 0, 0, 0],
            len: 3,
            body,
        }
    }

    /// The reply to a write: address and value, or address and quantity, as they came.
    #[inline]
    pub(crate) const fn echo(unit: u8, function: u8, [a, b, c, d]: [u8; 4]) -> Self {
        Self {
            bytes: [unit, function, a, b, c, d, 0, 0],
            len: 6,
            body: 0,
        }
    }

    /// The reply to a refused request.
    #[inline]
    pub(crate) const fn exception(unit: u8, function: u8, exception: Exception) -> Self {
        let function = function | Function::EXCEPTION;
        Self {
            bytes: [unit, function, exception.code(), 0, 0, 0, 0, 0],
            len: 3,
            body: 0,
        }
    }
}

/// The second step of serving a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// Nothing.
    None,
    /// Read these bits into the body.
    ReadBits(Span),
    /// Read these words into the body.
    ReadWords(Span),
    /// Write bits; they are packed in the request from byte `from` on.
    WriteBits {
        /// Where to.
        span: Span,
        /// Where they are in the request, counted from the unit address.
        from: u8,
    },
    /// Write words; they are in the request from byte `from` on.
    WriteWords {
        /// Where to.
        span: Span,
        /// Where they are in the request, counted from the unit address.
        from: u8,
    },
}

impl Work {
    /// What is left of it when nobody is answered.
    #[inline]
    pub(crate) const fn writes_only(self) -> Self {
        match self {
            Self::ReadBits(_) | Self::ReadWords(_) => Self::None,
            other => other,
        }
    }
}

/// How a request fared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// For another unit: not looked at, not counted.
    NotForUs,
    /// A function code no request can have (00, 80 and above): silence, counted as unanswered.
    NoRequest,
    /// Accepted, or a broadcast that has no effect.
    Accepted,
    /// Refused; on a broadcast without saying so.
    Refused(Exception),
}
