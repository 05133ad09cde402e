//! Which links a request may write, and which are in force: those of the digital outputs of the modules chosen last.

use modbus_server::{Exception, Span, Words};
use register_map::board::Board;
use register_map::links::WORDS;

use super::Config;
use super::links::Links;
use crate::links::Link;

impl<B: Board> Config<B> {
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
        if !Links::<B>::contain(span.start()) {
            return;
        }
        for address in span.addresses() {
            if let Some((slot, index)) = Links::<B>::place(address)
                && let Some(links) = self.written_links.get_mut(slot)
            {
                *links |= 1 << index;
            }
        }
    }

    /// Returns whether links were written since they were last set up.
    pub fn has_written_links(&self) -> bool {
        self.written_links.iter().any(|links| *links != 0)
    }

    /// Returns the links of a slot that were written since the last call, a bit for each. COMMAND 3 and 4 write all links.
    pub fn take_written_links(&mut self, slot: usize) -> u8 {
        self.written_links.get_mut(slot).map_or(0, core::mem::take)
    }

    /// Returns a link that is in force: until the restart one from or to a port whose MODULE has changed is not.
    #[must_use]
    pub fn link(&self, slot: usize, index: usize) -> &Link {
        let link = self.edited.links.link(slot, index);
        let from = link.source().map_or(slot, Links::<B>::slot_of);
        if self.is_in_force(slot) && self.is_in_force(from) {
            link
        } else {
            const { &Link::NONE }
        }
    }
}
