//! The start of a reply, as it is settled by the decision.

use crate::{Exception, Function};

/// The start of a reply: all of it for an exception or the echo of a write; unit, function and as
/// much as is known at once for all others, whose body follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
// Whole words: copied with every reply, without a call of memcpy.
#[repr(align(4))]
pub(crate) struct Head {
    bytes: [u8; Head::CAPACITY],
    len: u8,
    /// Where in its buffer the body begins; `NO_BODY` for none.
    body: u8,
}

/// No body begins there.
const NO_BODY: u8 = u8::MAX;

impl Head {
    /// The longest reply that needs no body: unit and PDU of a mask write (V1.1b3 6.16).
    const CAPACITY: usize = 8;

    /// How many bytes, without CRC.
    #[inline]
    pub(crate) const fn len(&self) -> u8 {
        self.len
    }

    /// One byte, below [`len`](Self::len).
    #[inline]
    pub(crate) fn get(&self, index: u8) -> u8 {
        // Of eight bytes: no check is left of this.
        let index = usize::from(index) % Self::CAPACITY;
        self.bytes.get(index).copied().unwrap_or_default()
    }

    /// Whether a body follows; if not, the head is the whole reply.
    #[inline]
    pub(crate) const fn has_body(&self) -> bool {
        self.body != NO_BODY
    }

    /// Where the body begins, if there is one.
    #[inline]
    pub(crate) const fn body_from(&self) -> u8 {
        self.body
    }

    /// Of a reply of which nothing is known but the unit address. More will follow.
    #[inline]
    pub(crate) const fn opening(unit: u8) -> Self {
        Self {
            bytes: [unit, 0, 0, 0, 0, 0, 0, 0],
            len: 1,
            body: 0,
        }
    }

    /// The reply to a read of `body` bytes.
    #[inline]
    pub(crate) const fn read(unit: u8, function: u8, body: u8) -> Self {
        Self {
            bytes: [unit, function, body, 0, 0, 0, 0, 0],
            len: 3,
            body: 0,
        }
    }

    /// A reply whose body is all that follows the function code.
    #[inline]
    pub(crate) const fn plain(unit: u8, function: u8) -> Self {
        Self {
            bytes: [unit, function, 0, 0, 0, 0, 0, 0],
            len: 2,
            body: 0,
        }
    }

    /// A reply whose first two bytes after the function code are known; the rest is the body.
    #[inline]
    pub(crate) const fn before(unit: u8, function: u8, [a, b]: [u8; 2]) -> Self {
        Self {
            bytes: [unit, function, a, b, 0, 0, 0, 0],
            len: 4,
            body: 0,
        }
    }

    /// As [`before`](Self::before), with the body where the request had what it replaces or
    /// repeats.
    #[inline]
    pub(crate) const fn in_place(unit: u8, function: u8, fields: [u8; 2]) -> Self {
        Self {
            body: 4,
            ..Self::before(unit, function, fields)
        }
    }

    /// The reply to a write: address and value, or address and quantity, as they came.
    #[inline]
    pub(crate) const fn echo(unit: u8, function: u8, [a, b, c, d]: [u8; 4]) -> Self {
        Self {
            bytes: [unit, function, a, b, c, d, 0, 0],
            len: 6,
            body: NO_BODY,
        }
    }

    /// The reply to a mask write: address and masks, as they came.
    #[inline]
    pub(crate) const fn masks(unit: u8, function: u8, [a, b, c, d, e, f]: [u8; 6]) -> Self {
        Self {
            bytes: [unit, function, a, b, c, d, e, f],
            len: 8,
            body: NO_BODY,
        }
    }

    /// The reply to a refused request.
    #[inline]
    pub(crate) const fn exception(unit: u8, function: u8, exception: Exception) -> Self {
        let function = function | Function::EXCEPTION;
        Self {
            bytes: [unit, function, exception.code(), 0, 0, 0, 0, 0],
            len: 3,
            body: NO_BODY,
        }
    }
}
