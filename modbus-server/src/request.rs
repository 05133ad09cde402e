//! A request between its port and its reply, and the reply. Each owns the buffer.

use crate::line::{Ending, Framing};
use crate::{Adu, Exception, LineCounters};

/// A valid request to this unit, or a broadcast, from [`Port::take`](crate::line::Port::take).
#[must_use = "its buffer belongs to the port"]
#[derive(Debug)]
pub struct Request<'a> {
    /// Unit address and PDU, without CRC or LRC.
    pub(crate) adu: &'a mut Adu,
    /// The counters of the line when it was taken.
    pub(crate) line: LineCounters,
    /// Tick in which the request ended.
    pub(crate) ended: u32,
    /// How the unit's last arbitration on this line has ended.
    pub(crate) ending: Ending,
}

impl Request<'_> {
    /// Returns the unit address; 0 for a broadcast.
    #[inline]
    #[must_use]
    pub fn unit(&self) -> u8 {
        self.adu.get(0)
    }

    /// Returns the tick in which the request ended.
    #[inline]
    #[must_use]
    pub const fn ended(&self) -> u32 {
        self.ended
    }
}

/// A request that has been served, from [`Server::serve`](crate::Server::serve). It holds the whole reply, if there is
/// one. [`Port::send`](crate::line::Port::send) sends it, and takes the buffer back.
#[must_use = "its buffer belongs to the port"]
#[derive(Debug)]
pub struct Reply<'a> {
    /// Unit address and PDU of the reply.
    pub(crate) adu: &'a mut Adu,
    pub(crate) is_answered: bool,
    /// Framing of what follows the reply.
    pub(crate) framing: Framing,
    pub(crate) outcome: Outcome,
    pub(crate) writes: bool,
}

impl Reply<'_> {
    /// Returns whether a reply is sent.
    #[inline]
    #[must_use]
    pub const fn is_answered(&self) -> bool {
        self.is_answered
    }

    /// Returns the result of the request.
    #[inline]
    #[must_use]
    pub const fn outcome(&self) -> Outcome {
        self.outcome
    }

    /// Returns whether the request has written coils or holding registers. File records do not count.
    #[inline]
    #[must_use]
    pub const fn writes(&self) -> bool {
        self.writes
    }
}

/// Result of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Outcome {
    /// An invalid function code (00, 80 and above): no reply, counted as unanswered.
    NoRequest,
    /// The unit is in listen-only mode (function 08, sub-function 04): no reply, counted as unanswered.
    NotObeyed,
    /// A broadcast of a function that only a single unit can execute: no effect.
    NoEffect,
    /// Accepted.
    Accepted,
    /// Rejected. A broadcast gets no reply, though.
    Refused(Exception),
}
