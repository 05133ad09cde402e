//! The bus: what answers at every address that the core does not answer by itself, and what the core is told
//! in return.
//!
//! The core reads flash and reads and writes SRAM without asking. All else comes here: stores to flash, the
//! register blocks, the factory's words, the debug blocks. Bit-band aliases arrive as a read and a write of
//! the word they stand for (PM0056 2.2.5).
//!
//! Bus faults are precise, as crate rigless has them. On the part the fault of a buffered store is imprecise: the
//! program counter is some instructions on, and BFAR is not valid (PM0056 4.4.11, 4.4.14).

use rigless::device::Level;
use rigless::emulator::{Access, AccessKind, CoreBus, InterruptLine, Queued};
use rigless::soc::Width as CoreWidth;
use rigless::time::VirtualNanos;

use super::dwt::{self, Dwt};
use super::memory::{FLASH_BASE, FLASH_SIZE, Memory, RAM_BASE, RAM_SIZE};
use super::segment::Segments;
use super::timing::InstructionClock;
use super::waits::Waits;
use crate::finding::{Findings, What, Width};
use crate::periph::dbgmcu::Dbgmcu;
use crate::periph::ident::{self, Ident};
use crate::peripheral::{Peripheral, Unmodelled};
use crate::soc::Soc;
use crate::soc::map::{self, Block, Place, Widths};
use crate::time::Time;

/// Where the private peripheral bus starts.
const PPB: u32 = 0xE000_0000;
const DBGMCU: u32 = 0xE004_2000;

/// Everything the core is lent while it runs, except the memories mapped into it.
#[derive(Debug)]
pub struct Bus {
    /// The part around the core.
    pub soc: Soc,
    /// Instructions to time.
    pub clock: InstructionClock,
    /// What was wrong.
    pub findings: Findings,
    pub(super) ident: Ident,
    pub(super) dbgmcu: Dbgmcu,
    pub(super) dwt: Dwt,
    /// The core is to come back before this instant, or before this many instructions (its own count).
    pub(super) stop: (Time, u64),
    /// An operation of the flash ran when the core was let run last.
    pub(super) busy: bool,
    /// The core has to come back at once.
    pub(super) halt: bool,
    /// What the core has to do before its next instruction.
    pub(super) queued: Vec<Queued>,
    /// The instruction that made the last access.
    pub(super) pc: u32,
    /// How long interrupts wait, when that is measured.
    pub(super) waits: Option<Box<Waits>>,
    /// The SRAM.
    pub(super) ram: Memory,
    /// What the code costs.
    pub(super) segments: Segments,
    /// Reads of flash come here, those of these pages, one bit each.
    pub(super) flash_is_watched: bool,
    pub(super) routed_pages: u128,
    /// The core has read flash while an operation runs, and waits for its end.
    pub(super) read_stalls: bool,
    /// A block has been accessed, so its next event may be another one.
    pub(super) touched: bool,
    /// The access under way leaves the core free to go on.
    pub(super) carries_on: bool,
}

/// An access as the blocks see it.
#[derive(Clone, Copy)]
struct Request {
    address: u32,
    width: Width,
    write: Option<u32>,
    now: Time,
    count: u64,
    pc: u32,
}

impl Request {
    /// Which byte of its word the access starts at.
    const fn lane(&self) -> u32 {
        self.address & 3
    }

    /// The part of `word` that this access reads.
    const fn part_of(&self, word: u32) -> u32 {
        let part = word >> (8 * self.lane());
        match self.width {
            Width::Byte => part & 0xFF,
            Width::Half => part & 0xFFFF,
            Width::Word => word,
        }
    }

    /// The value a store puts on the bus: a narrow one is repeated on every lane.
    const fn on_every_lane(&self, value: u32) -> u32 {
        match self.width {
            Width::Byte => (value & 0xFF) * 0x0101_0101,
            Width::Half => (value & 0xFFFF) * 0x0001_0001,
            Width::Word => value,
        }
    }
}

impl Bus {
    /// Everything due up to `now` happens, and what came of it is taken up. `count` instructions are done.
    pub(super) fn advance(&mut self, now: Time, count: u64) {
        if self.soc.next_event() <= now {
            self.soc.advance(now);
        }
        self.take_up(count);
    }

    /// Takes up what the blocks ask: interrupt lines, the instruction rate, findings, a reset.
    fn take_up(&mut self, count: u64) {
        if self.soc.lines_changed() {
            let (mut changed, levels) = self.soc.take_lines();
            while changed != 0 {
                let line = changed.trailing_zeros() as u16;
                changed &= changed - 1;
                let level = Level::from(levels >> line & 1 != 0);
                if let Some(line) = InterruptLine::new(line) {
                    self.queued.push(Queued::Line(line, level));
                }
            }
        }
        if self.soc.has_notes() {
            for (at, what) in self.soc.take_notes() {
                self.findings.add(at, self.pc, what);
            }
        }
        if core::mem::take(&mut self.soc.signals.rate) {
            self.update_rate(count);
        }
        let changed = self.soc.signals.flash.take();
        if let Some((first, end)) = changed {
            let base = u64::from(FLASH_BASE);
            self.queued
                .push(Queued::Invalidate(base + first as u64, base + end as u64));
        }
        self.route_flash(changed.is_some());
        // The machine makes the reset, and waits out the flash.
        let busy = self.soc.flash.busy_until().is_some();
        self.halt |= self.soc.signals.reset.is_some() || busy != self.busy;
    }

    /// The instruction rate follows HCLK and the flash's wait states.
    pub(super) fn update_rate(&mut self, count: u64) {
        let (wait_states, prefetch) = self.soc.flash.access_control();
        let hclk = self.soc.rcc.clocks().hclk;
        self.segments.set_flash(wait_states, prefetch);
        self.clock.set_rate(count, hclk);
    }

    /// Whether every read of constants in flash comes here, to be charged.
    pub(super) fn charges_tables(&self) -> bool {
        self.segments.pace().costs.charges_tables
    }

    /// What an access costs beyond one of SRAM.
    fn cost_of(&self, access: &Access, from_code: bool) -> u32 {
        let pace = self.segments.pace();
        let address = access.address as u32;
        let clocks = self.soc.rcc.clocks();
        let divider = |pclk: u32| Some(clocks.hclk.checked_div(pclk).unwrap_or(1));
        let write = access.kind == AccessKind::Write;
        match address {
            _ if !from_code => 0,
            // APB1, APB2 and AHB: RM0008 3.3, table 3.
            0x4000_0000..0x4001_0000 => pace.block(write, divider(clocks.pclk1)),
            0x4001_0000..0x4001_8000 => pace.block(write, divider(clocks.pclk2)),
            0x4001_8000..0x6000_0000 | PPB.. => pace.block(write, None),
            _ if self.charges_tables() && !write && flash_offset(address).is_some() => {
                pace.flash_read()
            }
            _ => 0,
        }
    }

    /// Answers an access; `None` is a bus fault.
    fn answer(&mut self, request: Request) -> Option<u32> {
        let address = request.address;
        match address {
            0x4000_0000..0x6000_0000 => Some(self.peripheral(request)),
            ident::BASE.. if address < ident::BASE + ident::SIZE => {
                self.read_only(request, |bus, offset| bus.ident.read(offset))
            }
            PPB..0xE010_0000 => Some(self.debug_block(request)),
            _ => match flash_offset(address) {
                Some(offset) if request.write.is_none() => {
                    let busy = self.soc.flash.busy_until().is_some();
                    self.read_stalls |= busy;
                    self.halt |= busy;
                    Some(self.flash_word(request, offset))
                }
                Some(offset) => self.store_to_flash(request, offset),
                None if address.wrapping_sub(RAM_BASE) < RAM_SIZE as u32 => {
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
            Place::Block(block) => block,
            Place::Absent(name) => {
                self.note_unmodelled(request, name);
                return 0;
            }
            Place::Reserved => {
                self.note_unmodelled(request, "a reserved address");
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

    /// The private peripheral bus outside what the core answers itself.
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

    /// The core reads and writes SRAM without asking, all but the page of the vector table while [`Waits`] has
    /// it sent here, and the pages of [`RamCode`](super::ram_code::RamCode).
    fn routed_ram(&mut self, request: Request, offset: u32) -> u32 {
        if let Some(value) = request.write {
            let bytes = value.to_le_bytes();
            let width = match request.width {
                Width::Byte => 1,
                Width::Half => 2,
                Width::Word => 4,
            };
            let at = offset as usize;
            self.ram.bytes_mut()[at..at + width].copy_from_slice(&bytes[..width]);
        }
        word_of(self.ram.bytes(), request, offset)
    }

    /// The core reads the flash without asking, all but pages with unsteady cells, and the page of the vector
    /// table while [`Waits`] has it sent here.
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

    fn note(&mut self, request: Request, what: What) {
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

/// What a read at `offset` of `memory` gives.
fn word_of(memory: &[u8], request: Request, offset: u32) -> u32 {
    let at = (offset & !3) as usize;
    request.part_of(u32::from_le_bytes([0, 1, 2, 3].map(|n| memory[at + n])))
}

/// The offset into flash of `address`, at its own place or at 0.
fn flash_offset(address: u32) -> Option<u32> {
    let size = FLASH_SIZE as u32;
    [FLASH_BASE, 0]
        .into_iter()
        .map(|base| address.wrapping_sub(base))
        .find(|&offset| offset < size)
}

impl CoreBus for Bus {
    fn access(&mut self, access: Access, from_code: bool) -> Option<u64> {
        self.clock.charge(self.cost_of(&access, from_code));
        let now = self.clock.time(access.instruction_count);
        if let Some(waits) = self.waits.as_mut().filter(|_| !from_code) {
            waits.vector_read(access.address as u32, now);
        }
        let request = Request {
            address: access.address as u32,
            width: match access.width {
                CoreWidth::W8 => Width::Byte,
                CoreWidth::W16 => Width::Half,
                _ => Width::Word,
            },
            write: (access.kind == AccessKind::Write).then_some(access.value as u32),
            now,
            count: access.instruction_count,
            pc: access.program_counter.unwrap_or(0) as u32,
        };
        self.pc = request.pc;
        if self.soc.next_event() <= now {
            self.soc.advance(now);
        }
        let answer = self.answer(request);
        self.take_up(access.instruction_count);
        // A line that rose is the core's to look at first.
        self.carries_on = self.queued.is_empty();
        self.touched = true;
        if let Some(complaint) = self.soc.flash.take_complaint() {
            self.note(request, What::Flash(complaint.text));
            if complaint.bus_error {
                return None;
            }
        }
        answer.map(u64::from)
    }

    /// The core's own time is the cycle of HCLK: its SysTick counts exactly those, whatever their rate.
    fn time(&self, instructions: u64) -> VirtualNanos {
        VirtualNanos(self.clock.cycle(instructions))
    }

    fn queued(&mut self) -> Vec<Queued> {
        core::mem::take(&mut self.queued)
    }

    fn carry_on(&mut self, instructions: u64, event: Option<VirtualNanos>) -> Option<u32> {
        // An access to the core's own registers, which may have pended an exception, does not set it.
        let carries_on = core::mem::take(&mut self.carries_on);
        if self.halt || self.waits.is_some() || !carries_on {
            return None;
        }
        let mut until = self.stop.0.min(self.soc.next_event());
        if let Some(VirtualNanos(cycle)) = event {
            until = until.min(self.clock.time_of_cycle(cycle));
        }
        let budget = self
            .clock
            .instructions_until(instructions, until)
            .min(self.stop.1.saturating_sub(instructions));
        Some(u32::try_from(budget).unwrap_or(u32::MAX)).filter(|&budget| budget > 0)
    }
}
