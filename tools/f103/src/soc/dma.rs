//! The DMA transfers between the blocks and the SRAM (RM0008 tables 78 and 79).

use super::map::{self, Block, Place};
use super::{Circuit, Soc};
use crate::finding::What;
use crate::memory::{FLASH_BASE, RAM_BASE};
use crate::periph::dma::Transfer;
use crate::peripheral::Unmodelled;
use crate::time::Time;

/// A channel: the controller and the channel in it, both from 0.
type Channel = (usize, usize);

/// Blocks that request transfers: the channel that reads the block, and the channel that writes the block.
const REQUESTERS: [(Block, [Option<Channel>; 2]); 5] = [
    (Block::Adc1, [Some((0, 0)), None]),
    (Block::Usart1, [Some((0, 4)), Some((0, 3))]),
    (Block::Usart2, [Some((0, 5)), Some((0, 6))]),
    (Block::Usart3, [Some((0, 2)), Some((0, 1))]),
    (Block::Uart4, [Some((1, 2)), Some((1, 4))]),
];

/// The controllers.
const CONTROLLERS: [Block; 2] = [Block::Dma1, Block::Dma2];

impl<C: Circuit> Soc<C> {
    /// Carries out the transfers that `block` requests. Returns whether there was one.
    pub(super) fn serve_dma(&mut self, block: Block, now: Time) -> bool {
        let Some((_, channels)) = REQUESTERS.iter().find(|(known, _)| *known == block) else {
            return false;
        };
        let mut served = false;
        for (direction, channel) in channels.iter().enumerate() {
            let Some((controller, n)) = *channel else {
                continue;
            };
            while self.block(block).dma_requests()[direction]
                && self.is_clocked(CONTROLLERS[controller])
                && let Some(transfer) = self.dma[controller].take(n)
            {
                served = true;
                if let Err(text) = self.carry_out(block, &transfer, now) {
                    self.dma[controller].fail(n);
                    self.notes.push((now, What::Other(text)));
                }
                self.note_requests(CONTROLLERS[controller]);
            }
        }
        served
    }

    /// Serves the blocks whose requests wait for a channel of a controller, which has been accessed.
    pub(super) fn wire_dma(&mut self, controller: usize, now: Time) {
        for (block, channels) in REQUESTERS {
            let mine = channels.into_iter().flatten();
            if mine.into_iter().any(|(known, _)| known == controller) && self.part.has(block) {
                self.catch_up(block, now);
                self.settle(block, now);
            }
        }
    }

    fn carry_out(
        &mut self,
        block: Block,
        transfer: &Transfer,
        now: Time,
    ) -> Result<(), &'static str> {
        let (address, width) = transfer.peripheral;
        let (place, offset) = map::place(address);
        if place != Place::Block(block) {
            return Err("a DMA transfer with another peripheral than the one of its request");
        }
        let (offset, lane) = (offset & !3, 8 * (offset & 3));
        if transfer.to_peripheral {
            let value = self.load(transfer.memory)?;
            let written = self.block(block).write(offset, value << lane, now);
            written.map_err(|Unmodelled(text)| text)
        } else {
            let read = self.block(block).read(offset, now);
            let value = read.map_err(|Unmodelled(text)| text)? >> lane;
            // RM0008 table 77: a narrower read is extended by zeros.
            let mask = u32::MAX >> (32 - 8 * width);
            self.store(transfer.memory, value & mask)
        }
    }

    fn load(&self, (address, width): (u32, usize)) -> Result<u32, &'static str> {
        let read = |bytes: &[u8], base: u32| {
            let at = address.checked_sub(base)? as usize;
            let bytes = bytes.get(at..at.checked_add(width)?)?;
            let value = bytes.iter().rev();
            Some(value.fold(0, |value, byte| value << 8 | u32::from(*byte)))
        };
        read(self.ram.bytes(), RAM_BASE)
            .or_else(|| read(self.flash.bytes(), FLASH_BASE))
            .ok_or("a DMA transfer from an address that is neither SRAM nor flash")
    }

    fn store(&mut self, (address, width): (u32, usize), value: u32) -> Result<(), &'static str> {
        let at = address.wrapping_sub(RAM_BASE) as usize;
        let bytes = self.ram.bytes_mut();
        let place = at.checked_add(width).and_then(|end| bytes.get_mut(at..end));
        let place = place.ok_or("a DMA transfer to an address that is not SRAM")?;
        place.copy_from_slice(&value.to_le_bytes()[..width]);
        Ok(())
    }
}
