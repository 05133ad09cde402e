//! The registers of the links, 0x0400 to 0x04FF: for the digital outputs of the modules chosen last.

use modbus_server::{Exception, Span, Words};
use register_map::links::{self, WORDS, point_of};
use register_map::points::{CHANNELS, Kind};

use super::Config;
use super::settings::{Settings, differences};
use crate::links::{Link, OF_A_SLOT};

/// The links of the points of a board with `SLOTS` slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Links<const SLOTS: usize> {
    /// The board's first point.
    first: u16,
    slots: [[Link; OF_A_SLOT]; SLOTS],
}

impl<const SLOTS: usize> Links<SLOTS> {
    /// The board has links. A constant, so that nothing of them is in the image of a board without.
    pub const EXIST: bool = links::exist(SLOTS);

    /// Returns whether an address is one of a link.
    pub const fn contain(address: u16) -> bool {
        Self::EXIST && links::contain(address)
    }

    /// Returns links that do nothing.
    pub const fn new(first: u16) -> Self {
        Self {
            first,
            slots: [[Link::NONE; OF_A_SLOT]; SLOTS],
        }
    }

    /// Returns the slot of a point. It is not below `SLOTS` for a point that the board does not have.
    pub fn slot_of(&self, point: u16) -> usize {
        usize::from(point.wrapping_sub(self.first) / CHANNELS)
    }

    /// Returns a link of a slot.
    pub fn link(&self, slot: usize, index: usize) -> &Link {
        let link = self.slots.get(slot).and_then(|slot| slot.get(index));
        link.unwrap_or(const { &Link::NONE })
    }

    /// Returns a link of a slot, to be changed.
    fn link_mut(&mut self, (slot, index): (usize, usize)) -> Option<&mut Link> {
        self.slots.get_mut(slot)?.get_mut(index)
    }

    /// Returns slot and number of the link of a register, if the board has it.
    #[inline(never)]
    pub fn place(&self, address: u16) -> Option<(usize, usize)> {
        let slot = self.slot_of(point_of(address));
        // The first links of the points, then the second ones.
        let index = (address >> 7 & 1) * CHANNELS + point_of(address) % CHANNELS;
        (links::contain(address) && slot < SLOTS).then_some((slot, usize::from(index)))
    }

    /// Returns the link of a register, if the board has it.
    pub fn at(&self, address: u16) -> Option<&Link> {
        if !Self::EXIST {
            return None;
        }
        let (slot, index) = self.place(address)?;
        Some(self.link(slot, index))
    }

    /// Sets a register, if the board has it.
    pub fn set(&mut self, address: u16, value: u16) {
        if let Some(place) = self.place(address)
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

impl<const SLOTS: usize> Settings<SLOTS> {
    /// Returns whether the chosen module has a digital output at the point of a register of the links.
    pub(super) fn has_link(&self, address: u16) -> bool {
        Links::<SLOTS>::contain(address) && self.kind(point_of(address)) == Kind::BitOutput
    }

    /// Returns whether the chosen modules allow a link.
    fn allows(&self, link: &Link) -> bool {
        link.suits(link.source().map_or(Kind::None, |source| self.kind(source)))
    }

    /// Sets to the default the links that the chosen modules do not allow, and those from or to a slot whose module has
    /// changed. Returns their number.
    pub(super) fn drop_links(&mut self, changed: Option<usize>) -> u16 {
        let mut dropped: u16 = 0;
        if !Links::<SLOTS>::EXIST {
            return dropped;
        }
        for slot in 0..SLOTS {
            for index in 0..OF_A_SLOT {
                let link = self.links.link(slot, index);
                let from = link.source().map(|source| self.links.slot_of(source));
                let to = Some(slot);
                if changed.is_some() && (changed == from || changed == to) || !self.allows(link) {
                    if let Some(link) = self.links.link_mut((slot, index)) {
                        *link = Link::NONE;
                    }
                    dropped = dropped.saturating_add(1);
                }
            }
        }
        dropped
    }
}

impl<const SLOTS: usize> Config<SLOTS> {
    /// Checks whether registers of links exist.
    ///
    /// # Errors
    ///
    /// Exception 02 when one does not belong to a digital output.
    pub(super) fn check_links(&self, span: Span) -> Result<(), Exception> {
        let addresses = u32::from(span.start())..span.end();
        if addresses
            .map(|address| address as u16)
            .all(|address| self.edited.has_link(address))
        {
            Ok(())
        } else {
            Err(Exception::IllegalDataAddress)
        }
    }

    /// Returns whether every link is consistent once these values are written.
    pub(super) fn suits_the_links(&self, span: Span, words: Words<'_>) -> bool {
        // The first register of each link that is written.
        let first = |address: &u16| *address == span.start() || address.is_multiple_of(WORDS);
        span.addresses().filter(first).all(|address| {
            let Some(mut link) = self.edited.links.at(address).copied() else {
                return false;
            };
            for (word, address) in link.0.iter_mut().zip(address / WORDS * WORDS..) {
                if let Some(written) = words.get(address.wrapping_sub(span.start())) {
                    *word = written;
                }
            }
            self.edited.allows(&link)
        })
    }

    /// Notes which links a write has written, also with the values that they had.
    pub(super) fn note_links(&mut self, span: Span) {
        if !Links::<SLOTS>::contain(span.start()) {
            return;
        }
        for address in span.addresses() {
            if let Some((slot, index)) = self.edited.links.place(address)
                && let Some(links) = self.written_links.get_mut(slot)
            {
                *links |= 1 << index;
            }
        }
    }

    /// Returns the links of a slot that were written since the last call, a bit for each. COMMAND 3 and 4 write all links.
    pub fn take_written_links(&mut self, slot: usize) -> u8 {
        self.written_links.get_mut(slot).map_or(0, core::mem::take)
    }

    /// Returns a link that is in force: until the restart one from or to a port whose MODULE has changed is not.
    #[must_use]
    pub fn link(&self, slot: usize, index: usize) -> &Link {
        let link = self.edited.links.link(slot, index);
        let from = link
            .source()
            .map_or(slot, |source| self.edited.links.slot_of(source));
        if self.is_in_force(slot) && self.is_in_force(from) {
            link
        } else {
            const { &Link::NONE }
        }
    }
}
