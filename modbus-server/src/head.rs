//! The first bytes of a reply, which the decision determines.

use crate::{Exception, Function};

/// The first bytes of a reply. For an exception or the echo of a write they are the whole reply. For all others
/// they are unit, function and the other bytes that are known immediately, and a body follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
// Aligned to words: every reply copies the head, and this avoids a call of memcpy.
#[repr(align(4))]
pub(crate) struct Head {
    bytes: [u8; Head::CAPACITY],
    len: u8,
    /// Index in its buffer at which the body begins; `NO_BODY` for none.
    body: u8,
}

/// There is no body.
const NO_BODY: u8 = u8::MAX;

impl Head {
    /// Length of the longest reply without a body: unit and PDU of a mask write (V1.1b3 6.16).
    const CAPACITY: usize = 8;

    /// Returns the number of bytes, without CRC.
    #[inline]
    pub(crate) const fn len(&self) -> u8 {
        self.len
    }

    /// Returns the byte at an index below [`len`](Self::len).
    #[inline]
    pub(crate) fn get(&self, index: u8) -> u8 {
        // There are eight bytes, so the compiler removes the bounds check.
        let index = usize::from(index) % Self::CAPACITY;
        self.bytes.get(index).copied().unwrap_or_default()
    }

    /// Returns whether a body follows. If not, the head is the whole reply.
    #[inline]
    pub(crate) const fn has_body(&self) -> bool {
        self.body != NO_BODY
    }

    /// Returns the index at which the body begins, if there is one.
    #[inline]
    pub(crate) const fn body_from(&self) -> u8 {
        self.body
    }

    /// Returns the head of a reply of which only the unit address is known. The rest follows later.
    #[inline]
    pub(crate) const fn opening(unit: u8) -> Self {
        Self {
            bytes: [unit, 0, 0, 0, 0, 0, 0, 0],
            len: 1,
            body: 0,
        }
    }

    /// Returns the head of a reply to a read, with `body` bytes.
    #[inline]
    pub(crate) const fn read(unit: u8, function: u8, body: u8) -> Self {
        Self {
            bytes: [unit, function, body, 0, 0, 0, 0, 0],
            len: 3,
            body: 0,
        }
    }

    /// Returns the head of a reply whose body begins after the function code.
    #[inline]
    pub(crate) const fn plain(unit: u8, function: u8) -> Self {
        Self {
            bytes: [unit, function, 0, 0, 0, 0, 0, 0],
            len: 2,
            body: 0,
        }
    }

    /// Returns the head of a reply with two known bytes after the function code; the rest is the body.
    #[inline]
    pub(crate) const fn before(unit: u8, function: u8, [a, b]: [u8; 2]) -> Self {
        Self {
            bytes: [unit, function, a, b, 0, 0, 0, 0],
            len: 4,
            body: 0,
        }
    }

    /// Like [`before`](Self::before), but the body replaces or repeats the bytes at the same place of the request.
    #[inline]
    pub(crate) const fn in_place(unit: u8, function: u8, fields: [u8; 2]) -> Self {
        Self {
            body: 4,
            ..Self::before(unit, function, fields)
        }
    }

    /// Returns the reply to a write: address and value, or address and quantity, as received.
    #[inline]
    pub(crate) const fn echo(unit: u8, function: u8, [a, b, c, d]: [u8; 4]) -> Self {
        Self {
            bytes: [unit, function, a, b, c, d, 0, 0],
            len: 6,
            body: NO_BODY,
        }
    }

    /// Returns the reply to a mask write: address and masks, as received.
    #[inline]
    pub(crate) const fn masks(unit: u8, function: u8, [a, b, c, d, e, f]: [u8; 6]) -> Self {
        Self {
            bytes: [unit, function, a, b, c, d, e, f],
            len: 8,
            body: NO_BODY,
        }
    }

    /// Returns the reply to a rejected request.
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
