//! The values of the registers of the links, 0x0400 to 0x04FF.

use register_map::board::{Board, Each};
use register_map::links::{self, point_of};
use register_map::points::CHANNELS;

use crate::links::{Link, OF_A_SLOT};

/// The links of the points of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Links<B: Board> {
    slots: Each<B::Ports, [Link; OF_A_SLOT]>,
}

impl<B: Board> Links<B> {
    /// The board has links. A constant, so that nothing of them is in the image of a board without.
    pub const EXIST: bool = B::ROW.has_links();

    /// Returns whether an address is one of a link.
    pub const fn contain(address: u16) -> bool {
        Self::EXIST && links::contain(address)
    }

    /// Returns links that do nothing.
    pub fn new() -> Self {
        Self {
            slots: Each::all([Link::NONE; OF_A_SLOT]),
        }
    }

    /// Returns the slot of a point. It is not below the number of slots for a point that the board does not have.
    pub fn slot_of(point: u16) -> usize {
        usize::from(point.wrapping_sub(B::ROW.points().start) / CHANNELS)
    }

    /// Returns a link of a slot.
    pub fn link(&self, slot: usize, index: usize) -> &Link {
        let link = self.slots.get(slot).and_then(|slot| slot.get(index));
        link.unwrap_or(const { &Link::NONE })
    }

    /// Returns a link of a slot, to be changed.
    pub fn link_mut(&mut self, (slot, index): (usize, usize)) -> Option<&mut Link> {
        self.slots.get_mut(slot)?.get_mut(index)
    }

    /// Returns slot and number of the link of a register, if the board has it.
    #[inline(never)]
    pub fn place(address: u16) -> Option<(usize, usize)> {
        let slot = Self::slot_of(point_of(address));
        // The first links of the points, then the second ones.
        let index = (address >> 7 & 1) * CHANNELS + point_of(address) % CHANNELS;
        (links::contain(address) && slot < B::PORTS).then_some((slot, usize::from(index)))
    }

    /// Returns the link of a register, if the board has it.
    pub fn at(&self, address: u16) -> Option<&Link> {
        if !Self::EXIST {
            return None;
        }
        let (slot, index) = Self::place(address)?;
        Some(self.link(slot, index))
    }

    /// Sets a register, if the board has it.
    pub fn set(&mut self, address: u16, value: u16) {
        if let Some(place) = Self::place(address)
            && let Some(link) = self.link_mut(place)
        {
            *link.word_mut(address) = value;
        }
    }

    /// Returns a register that differs from its default.
    pub fn changed(&self, address: u16) -> Option<u16> {
        let value = self.at(address)?.word(address);
        (value != Link::NONE.word(address)).then_some(value)
    }

    /// Returns the number of registers that differ from those of `from`.
    pub fn differences(&self, from: &Self) -> u16 {
        if !Self::EXIST {
            return 0;
        }
        let links = self.slots.as_flattened().iter();
        let pairs = links.zip(from.slots.as_flattened());
        pairs.map(|(a, b)| differences(&a.0, &b.0)).sum()
    }
}

/// Returns the number of words that differ.
pub(super) fn differences(a: &[u16], b: &[u16]) -> u16 {
    a.iter().zip(b).map(|(a, b)| u16::from(a != b)).sum()
}
