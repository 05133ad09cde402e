//! The bus: the answers at every address that is outside the core.
//!
//! The core reads flash, and reads and writes SRAM, without the bus. All other accesses come here: stores to flash, the
//! register blocks, the factory's words, the debug blocks. Bit-band aliases arrive as a read and a write of
//! the word they stand for (PM0056 2.2.5).
//!
//! All bus faults are precise, as in crate rigless. On the part the fault of a buffered store is imprecise: the
//! program counter is already some instructions further, and BFAR is not valid (PM0056 4.4.11, 4.4.14).

use rigless::device::Level;
use rigless::emulator::{Access, AccessKind, CoreBus, InterruptLine, Queued};
use rigless::soc::Width as CoreWidth;
use rigless::time::VirtualNanos;

use super::dwt::Dwt;
use super::request::{PPB, Request};
use super::segment::Segments;
use super::timing::InstructionClock;
use super::waits::Waits;
use crate::finding::{Findings, What, Width};
use crate::memory::FLASH_BASE;
use crate::part::Part;
use crate::periph::dbgmcu::Dbgmcu;
use crate::periph::ident::Ident;
use crate::soc::{Circuit, Soc};
use crate::time::Time;

/// Everything that the core uses while it runs, except the memories mapped into it.
#[derive(Debug)]
pub struct Bus<C> {
    /// Which part it is.
    pub(super) part: &'static Part,
    /// The part around the core.
    pub soc: Soc<C>,
    /// Converts instructions to time.
    pub clock: InstructionClock,
    /// The findings so far.
    pub findings: Findings,
    pub(super) ident: Ident,
    pub(super) dbgmcu: Dbgmcu,
    pub(super) dwt: Dwt,
    /// The core is to come back before this instant, or before this many instructions (its own count).
    pub(super) stop: (Time, u64),
    /// An operation of the flash ran when the core was let run last.
    pub(super) busy: bool,
    /// The core has to return immediately.
    pub(super) halt: bool,
    /// Actions of the core before its next instruction.
    pub(super) queued: Vec<Queued>,
    /// The instruction that made the last access.
    pub(super) pc: u32,
    /// The measurement of interrupt waits, while it is on.
    pub(super) waits: Option<Box<Waits>>,
    /// The costs of the code.
    pub(super) segments: Segments,
    /// Reads of flash come here: all of them, or those of these pages of the core's.
    pub(super) flash_is_watched: bool,
    pub(super) routed_pages: Vec<bool>,
    /// The core has read flash while an operation runs, and waits for its end.
    pub(super) read_stalls: bool,
    /// A block has been accessed, so its next event may have changed.
    pub(super) touched: bool,
    /// The core may continue after the access under way.
    pub(super) carries_on: bool,
}

impl<C: Circuit> Bus<C> {
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
            self.take_notes();
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

    /// Takes up the findings of the blocks and of the circuit.
    pub fn take_notes(&mut self) {
        for (at, what) in self.soc.take_notes() {
            self.findings.add(at, self.pc, what);
        }
    }

    /// The instruction rate follows HCLK and the flash's wait states.
    pub(super) fn update_rate(&mut self, count: u64) {
        let (wait_states, prefetch) = self.soc.flash.access_control();
        let hclk = self.soc.rcc.clocks().hclk;
        self.segments.set_flash(wait_states, prefetch);
        self.clock.set_rate(count, hclk);
    }

    /// Returns whether every read of constants in flash comes here, to be charged.
    pub(super) fn charges_tables(&self) -> bool {
        self.segments.pace().costs.charges_tables
    }

    /// Returns the cost of an access beyond the cost of an access to SRAM.
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
            _ if self.charges_tables() && !write && self.flash_offset(address).is_some() => {
                pace.flash_read()
            }
            _ => 0,
        }
    }
}

impl<C: Circuit> CoreBus for Bus<C> {
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

    /// Returns the core's own time, which is the cycle of HCLK: its SysTick counts exactly those, whatever their rate.
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
