//! What answers an access of the core: the register blocks, the factory's words, the debug blocks, and the memories
//! where they are not read directly.

use super::bus::Bus;
use super::dwt;
use super::request::{PPB, Request};
use crate::finding::{What, Width};
use crate::memory::{FLASH_BASE, RAM_BASE};
use crate::periph::ident;
use crate::peripheral::{Peripheral, Unmodelled};
use crate::soc::Circuit;
use crate::soc::map::{self, Block, Place, Widths};

const DBGMCU: u32 = 0xE004_2000;

impl<C: Circuit> Bus<C> {
    /// Answers an access; `None` is a bus fault.
    pub(super) fn answer(&mut self, request: Request) -> Option<u32> {
        let address = request.address;
        match address {
            0x4000_0000..0x6000_0000 => Some(self.peripheral(request)),
            ident::BASE.. if address < ident::BASE + ident::SIZE => {
                self.read_only(request, |bus, offset| bus.ident.read(offset))
            }
            PPB..0xE010_0000 => Some(self.debug_block(request)),
            _ => match self.flash_offset(address) {
                Some(offset) if request.write.is_none() => {
                    if self.soc.flash.busy_until().is_some() {
                        self.read_stalls = true;
                        self.halt = true;
                        if request.pc >= RAM_BASE {
                            self.note(request, What::StalledRead { address });
                        }
                    }
                    Some(self.flash_word(request, offset))
                }
                Some(offset) => self.store_to_flash(request, offset),
                None if (address.wrapping_sub(RAM_BASE) as usize) < self.part.ram_size => {
                    Some(self.routed_ram(request, address - RAM_BASE))
                }
                None => {
                    self.note(
                        request,
                        What::NoSuchAddress {
                            address,
                            write: request.write.is_some(),
                        },
                    );
                    None
                }
            },
        }
    }

    /// Returns the offset into flash of `address`, at its own place or at 0.
    pub(crate) fn flash_offset(&self, address: u32) -> Option<u32> {
        [FLASH_BASE, 0]
            .into_iter()
            .map(|base| address.wrapping_sub(base))
            .find(|&offset| (offset as usize) < self.part.flash_size)
    }

    fn read_only(&mut self, request: Request, read: impl FnOnce(&Self, u32) -> u32) -> Option<u32> {
        if request.write.is_some() {
            self.note(request, What::Other("a store to the factory's memory"));
            return None;
        }
        let word = read(self, (request.address - ident::BASE) & !3);
        Some(request.part_of(word))
    }

    fn peripheral(&mut self, request: Request) -> u32 {
        let Request { address, write, .. } = request;
        let (place, offset) = map::place(address);
        let block = match place {
            Place::Block(block) if self.part.has(block) => block,
            Place::Absent(name) => {
                self.note_unmodelled(request, name);
                return 0;
            }
            Place::Block(_) | Place::Reserved => {
                let name = self.part.unmodelled(address);
                self.note_unmodelled(request, name.unwrap_or("a reserved address"));
                return 0;
            }
        };
        if !self.soc.is_clocked(block) {
            self.note(
                request,
                What::Unclocked {
                    address,
                    write: write.is_some(),
                    block: block.name(),
                },
            );
            return 0;
        }
        self.check_width(request, block);
        let answer = match write {
            Some(value) => self.write_block(request, block, offset, value),
            None => self.soc.read(block, offset & !3, request.now),
        };
        match answer {
            Ok(word) => request.part_of(word),
            Err(Unmodelled(name)) => {
                self.note_unmodelled(request, name);
                0
            }
        }
    }

    fn write_block(
        &mut self,
        request: Request,
        block: Block,
        offset: u32,
        value: u32,
    ) -> Result<u32, Unmodelled> {
        let mut word = request.on_every_lane(value);
        if block.widths() == Widths::Any && request.width != Width::Word {
            // A block that takes bytes changes only the lanes written.
            let mask = if request.width == Width::Byte {
                0xFF
            } else {
                0xFFFF
            } << (8 * request.lane());
            let held = self.soc.read(block, offset & !3, request.now)?;
            word = held & !mask | word & mask;
        }
        self.soc
            .write(block, offset & !3, word, request.now)
            .map(|()| 0)
    }

    fn check_width(&mut self, request: Request, block: Block) {
        let fits = match block.widths() {
            Widths::Any => true,
            Widths::HalfWord => request.width != Width::Byte,
            Widths::Word => request.width == Width::Word,
        };
        if !fits {
            self.note(
                request,
                What::OddAccess {
                    address: request.address,
                    width: request.width,
                    block: block.name(),
                },
            );
        }
    }

    /// Answers an access to the private peripheral bus that the core does not answer itself.
    fn debug_block(&mut self, request: Request) -> u32 {
        let Request {
            address,
            now,
            count,
            ..
        } = request;
        let cycle = self.clock.cycle(count);
        let word = address & !3;
        let answer = match (address, request.write) {
            (dwt::BASE.., Some(value)) if address < dwt::BASE + dwt::SIZE => {
                let answer = self.dwt.write(word - dwt::BASE, value, cycle).map(|()| 0);
                self.halt |= self.dwt.awaits_look();
                answer
            }
            (dwt::BASE.., None) if address < dwt::BASE + dwt::SIZE => {
                self.dwt.read(word - dwt::BASE, cycle)
            }
            (DBGMCU.., Some(value)) if address < DBGMCU + 0x1000 => {
                self.dbgmcu.write(word - DBGMCU, value, now).map(|()| 0)
            }
            (DBGMCU.., None) if address < DBGMCU + 0x1000 => self.dbgmcu.read(word - DBGMCU, now),
            _ => Err(Unmodelled("a debug block of the core")),
        };
        match answer {
            Ok(word) => request.part_of(word),
            Err(Unmodelled(name)) => {
                self.note_unmodelled(request, name);
                0
            }
        }
    }

    /// Answers an access to SRAM that is sent to the bus: to the page of the vector table while
    /// [`Waits`](super::waits::Waits) watches it, and to the pages of [`RamCode`](super::ram_code::RamCode). The core
    /// accesses all other pages directly.
    fn routed_ram(&mut self, request: Request, offset: u32) -> u32 {
        if let Some(value) = request.write {
            let bytes = value.to_le_bytes();
            let width = match request.width {
                Width::Byte => 1,
                Width::Half => 2,
                Width::Word => 4,
            };
            let at = offset as usize;
            self.soc.ram.bytes_mut()[at..at + width].copy_from_slice(&bytes[..width]);
        }
        word_of(self.soc.ram.bytes(), request, offset)
    }

    /// Answers a read of flash that is sent to the bus: of pages with unsteady cells, and of the page of the vector
    /// table while [`Waits`](super::waits::Waits) watches it. The core reads all other pages directly.
    fn flash_word(&mut self, request: Request, offset: u32) -> u32 {
        let at = (offset & !3) as usize;
        request.part_of(self.soc.flash.read_word(at))
    }

    fn store_to_flash(&mut self, request: Request, offset: u32) -> Option<u32> {
        let value = request.write? as u16;
        let half = request.width == Width::Half;
        self.soc.program(offset, half, value, request.now);
        Some(0)
    }

    pub(super) fn note(&mut self, request: Request, what: What) {
        self.findings.add(request.now, request.pc, what);
    }

    fn note_unmodelled(&mut self, request: Request, name: &'static str) {
        self.note(
            request,
            What::Unmodelled {
                address: request.address,
                write: request.write.is_some(),
                name,
            },
        );
    }
}

/// Returns the value of a read at `offset` of `memory`.
fn word_of(memory: &[u8], request: Request, offset: u32) -> u32 {
    let at = (offset & !3) as usize;
    request.part_of(u32::from_le_bytes([0, 1, 2, 3].map(|n| memory[at + n])))
}
