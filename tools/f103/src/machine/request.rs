//! An access of the core to the bus.

use crate::finding::Width;
use crate::time::Time;

/// Where the private peripheral bus starts.
pub(super) const PPB: u32 = 0xE000_0000;

/// An access of the core, in the form in which the blocks receive it.
#[derive(Clone, Copy)]
pub(super) struct Request {
    pub(super) address: u32,
    pub(super) width: Width,
    pub(super) write: Option<u32>,
    pub(super) now: Time,
    pub(super) count: u64,
    pub(super) pc: u32,
}

impl Request {
    /// Returns the byte of its word at which the access starts.
    pub(super) const fn lane(&self) -> u32 {
        self.address & 3
    }

    /// Returns the part of `word` that this access reads.
    pub(super) const fn part_of(&self, word: u32) -> u32 {
        let part = word >> (8 * self.lane());
        match self.width {
            Width::Byte => part & 0xFF,
            Width::Half => part & 0xFFFF,
            Width::Word => word,
        }
    }

    /// Returns the value that a store puts on the bus: a narrow value is repeated on every lane.
    pub(super) const fn on_every_lane(&self, value: u32) -> u32 {
        match self.width {
            Width::Byte => (value & 0xFF) * 0x0101_0101,
            Width::Half => (value & 0xFFFF) * 0x0001_0001,
            Width::Word => value,
        }
    }
}
