//! A DMA controller, RM0008 chapter 13: transfers between a peripheral and a memory, each by a request of the peripheral.
//!
//! A [`Transfer`] takes no time, and the core does not wait for the bus: the part around the controller carries it out
//! at the instant of its request. Transfers from memory to memory and the priorities of channels are not modelled.

use crate::peripheral::{Peripheral, Unmodelled};
use crate::time::Time;

#[cfg(test)]
mod tests;

/// CCR, 13.4.3.
mod ccr {
    pub const EN: u32 = 1 << 0;
    pub const TCIE: u32 = 1 << 1;
    pub const HTIE: u32 = 1 << 2;
    pub const TEIE: u32 = 1 << 3;
    pub const DIR: u32 = 1 << 4;
    pub const CIRC: u32 = 1 << 5;
    pub const PINC: u32 = 1 << 6;
    pub const MINC: u32 = 1 << 7;
    pub const PSIZE: u32 = 8;
    pub const MSIZE: u32 = 10;
    pub const MEM2MEM: u32 = 1 << 14;
    pub const MASK: u32 = 0x7FFF;
}

/// The flags of a channel in ISR and IFCR, shifted by four bits for each channel (13.4.1).
mod flag {
    pub const GLOBAL: u32 = 1 << 0;
    pub const COMPLETE: u32 = 1 << 1;
    pub const HALF: u32 = 1 << 2;
    pub const ERROR: u32 = 1 << 3;
    pub const ALL: u32 = 0xF;
}

/// Bytes of the registers of one channel, with a reserved word.
const CHANNEL: u32 = 0x14;
/// Offset of the registers of the first channel.
const CHANNELS: u32 = 0x08;

/// One transfer of a channel: a read, then a write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transfer {
    /// Address in the peripheral region, and the number of bytes accessed there.
    pub peripheral: (u32, usize),
    /// Address in the memory, and the number of bytes accessed there.
    pub memory: (u32, usize),
    /// The memory is read and the peripheral written; otherwise the reverse.
    pub to_peripheral: bool,
}

#[derive(Clone, Copy, Debug, Default)]
struct Channel {
    ccr: u32,
    cndtr: u16,
    cpar: u32,
    cmar: u32,
    /// CNDTR when the channel was enabled, for the circular mode.
    length: u16,
}

impl Channel {
    /// Returns the bytes of one access, by the field of CCR at bit `shift` (13.4.3).
    const fn width(&self, shift: u32) -> usize {
        match self.ccr >> shift & 3 {
            0 => 1,
            1 => 2,
            _ => 4,
        }
    }

    /// Returns the address of the access after `done` transfers.
    const fn address(&self, base: u32, shift: u32, increments: u32, done: u16) -> u32 {
        let width = self.width(shift) as u32;
        // An address is aligned to its width (13.4.5).
        let steps = if self.ccr & increments != 0 {
            done as u32
        } else {
            0
        };
        (base & !(width - 1)).wrapping_add(width * steps)
    }
}

/// A DMA controller.
#[derive(Debug)]
pub struct Dma {
    channels: Vec<Channel>,
    isr: u32,
}

impl Dma {
    /// Returns a controller with this number of channels, after reset.
    #[must_use]
    pub fn new(channels: usize) -> Self {
        Self {
            channels: vec![Channel::default(); channels],
            isr: 0,
        }
    }

    /// Takes the next transfer of channel `n`, from 0, for a request of its peripheral: counts it, and sets the flags of
    /// its end. `None` while the channel is off, or after its last transfer.
    pub fn take(&mut self, n: usize) -> Option<Transfer> {
        let channel = &mut self.channels[n];
        if channel.ccr & ccr::EN == 0 || channel.cndtr == 0 {
            return None;
        }
        let done = channel.length.wrapping_sub(channel.cndtr);
        let transfer = Transfer {
            peripheral: (
                channel.address(channel.cpar, ccr::PSIZE, ccr::PINC, done),
                channel.width(ccr::PSIZE),
            ),
            memory: (
                channel.address(channel.cmar, ccr::MSIZE, ccr::MINC, done),
                channel.width(ccr::MSIZE),
            ),
            to_peripheral: channel.ccr & ccr::DIR != 0,
        };
        channel.cndtr -= 1;
        let mut flags = 0;
        if done + 1 == channel.length / 2 {
            flags |= flag::HALF;
        }
        if channel.cndtr == 0 {
            flags |= flag::COMPLETE;
            if channel.ccr & ccr::CIRC != 0 {
                channel.cndtr = channel.length;
            }
        }
        self.raise(n, flags);
        Some(transfer)
    }

    /// Ends channel `n` because its access has failed (13.3.5).
    pub fn fail(&mut self, n: usize) {
        self.channels[n].ccr &= !ccr::EN;
        self.raise(n, flag::ERROR);
    }

    fn raise(&mut self, n: usize, flags: u32) {
        if flags != 0 {
            self.isr |= (flags | flag::GLOBAL) << (4 * n);
        }
    }

    /// Returns the channels that request an interrupt, one bit each.
    #[must_use]
    pub fn requests(&self) -> u32 {
        let requests = |(n, channel): (usize, &Channel)| {
            let flags = self.isr >> (4 * n);
            [
                (ccr::TCIE, flag::COMPLETE),
                (ccr::HTIE, flag::HALF),
                (ccr::TEIE, flag::ERROR),
            ]
            .into_iter()
            .any(|(enable, flag)| channel.ccr & enable != 0 && flags & flag != 0)
        };
        let channels = self.channels.iter().enumerate();
        channels.fold(0, |mask, (n, channel)| {
            mask | u32::from(requests((n, channel))) << n
        })
    }

    /// Returns the channel at `offset`, and the offset in its registers.
    fn channel(&mut self, offset: u32) -> Option<(&mut Channel, u32)> {
        let from = offset.checked_sub(CHANNELS)?;
        let channel = self.channels.get_mut((from / CHANNEL) as usize)?;
        Some((channel, from % CHANNEL))
    }
}

impl Peripheral for Dma {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        if offset == 0 {
            return Ok(self.isr);
        }
        Ok(match self.channel(offset) {
            // IFCR is write-only.
            None if offset == 4 => 0,
            Some((channel, 0x0)) => channel.ccr,
            Some((channel, 0x4)) => channel.cndtr.into(),
            Some((channel, 0x8)) => channel.cpar,
            Some((channel, 0xC)) => channel.cmar,
            _ => return Err(Unmodelled("a reserved address of DMA")),
        })
    }

    fn write(&mut self, offset: u32, value: u32, _now: Time) -> Result<(), Unmodelled> {
        match offset {
            0 => return Ok(()),
            4 => {
                for n in 0..self.channels.len() {
                    let mut clear = value >> (4 * n) & flag::ALL;
                    if clear & flag::GLOBAL != 0 {
                        clear = flag::ALL;
                    }
                    self.isr &= !(clear << (4 * n));
                    if self.isr >> (4 * n) & (flag::ALL & !flag::GLOBAL) == 0 {
                        self.isr &= !(flag::GLOBAL << (4 * n));
                    }
                }
                return Ok(());
            }
            _ => {}
        }
        let Some((channel, register)) = self.channel(offset) else {
            return Err(Unmodelled("a reserved address of DMA"));
        };
        let enabled = channel.ccr & ccr::EN != 0;
        match register {
            0x0 => {
                channel.ccr = value & ccr::MASK;
                if !enabled {
                    channel.length = channel.cndtr;
                }
                if value & ccr::MEM2MEM != 0 {
                    return Err(Unmodelled("DMA from memory to memory"));
                }
            }
            // RM0008 13.4.4 to 13.4.6: not to be written while the channel is enabled.
            0x4 | 0x8 | 0xC if enabled => {
                return Err(Unmodelled(
                    "DMA CNDTR, CPAR or CMAR written while its channel is enabled: the write is lost",
                ));
            }
            0x4 => channel.cndtr = value as u16,
            0x8 => channel.cpar = value,
            0xC => channel.cmar = value,
            _ => return Err(Unmodelled("a reserved address of DMA")),
        }
        Ok(())
    }

    fn irq(&self) -> bool {
        self.requests() != 0
    }

    fn reset(&mut self, _now: Time) {
        *self = Self::new(self.channels.len());
    }
}
