//! The accesses of the core to the blocks and to the flash.

use super::map::Block;
use super::{Circuit, Soc};
use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

impl<C: Circuit> Soc<C> {
    /// Reads the register of `block` at `offset` (word aligned).
    ///
    /// # Errors
    ///
    /// As [`Peripheral::read`].
    pub fn read(&mut self, block: Block, offset: u32, now: Time) -> Result<u32, Unmodelled> {
        self.catch_up(block, now);
        let answer = self.block(block).read(offset, now);
        self.settle(block, now);
        self.find_next();
        answer
    }

    /// Writes the register of `block` at `offset` (word aligned). The write is lost while RCC holds the block in reset.
    ///
    /// # Errors
    ///
    /// As [`Peripheral::write`].
    pub fn write(
        &mut self,
        block: Block,
        offset: u32,
        value: u32,
        now: Time,
    ) -> Result<(), Unmodelled> {
        let (apb2, apb1) = self.rcc.held_in_reset();
        if apb2 | apb1 != 0
            && block
                .clock()
                .is_some_and(|(bus, bit)| [apb2, apb1, 0][bus] >> bit & 1 != 0)
        {
            return Ok(());
        }
        self.catch_up(block, now);
        let answer = self.block(block).write(offset, value, now);
        self.settle(block, now);
        self.find_next();
        answer
    }

    /// Returns whether `block` has its clock (RM0008 7.3.7, 7.3.8).
    #[must_use]
    pub fn is_clocked(&self, block: Block) -> bool {
        let enabled = self.rcc.enabled();
        block
            .clock()
            .is_none_or(|(bus, bit)| enabled[bus] >> bit & 1 != 0)
    }

    /// Handles a store of the core to the flash at `offset`. `half` says whether it is a half-word.
    pub fn program(&mut self, offset: u32, half: bool, value: u16, now: Time) {
        self.flash.advance(now);
        self.flash.program(offset, half, value, now);
        self.settle(Block::Flash, now);
        self.find_next();
    }
}
