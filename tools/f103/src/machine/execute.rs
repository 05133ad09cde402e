//! Executes code on the core, one segment at a time, and charges the cycles that the segment takes.

use rigless::emulator::Exit;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use super::run::{IPSR, Limit, XPSR};
use super::segment::{End, Place};
use super::{Chip, FLASH_BASE, RAM_BASE};
use crate::finding::What;
use crate::soc::Circuit;
use crate::time::Time;

/// The vector table's offset (PM0056 4.4.4).
const VTOR: u64 = 0xE000_ED08;

/// The number of the hard fault, and of core registers as [`Chip::register`] numbers them.
const HARD_FAULT: u32 = 3;
const LR: usize = 14;
const MSP: usize = 17;
const PSP: usize = 18;
/// The bit of EXC_RETURN that selects the process stack, and the place of the return address in the stack frame (PM0056
/// 2.3.7).
const SPSEL: u32 = 1 << 2;
const RETURN_ADDRESS: u32 = 24;
/// Finding when BKPT has caused a hard fault.
const BREAKPOINT: &str = "BKPT stops for a debugger; without one, as here, it is a hard fault";

/// The active exception.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Active {
    /// Number of the exception, 0 for none.
    number: u32,
    /// Address of the handler.
    handler: u32,
}

impl<C: Circuit> Chip<C> {
    /// Lets the core run until the next event or limit, or until the core has to be looked at.
    pub(super) fn execute(&mut self, limit: Limit) -> Exit {
        let stop = limit
            .time
            .min(self.cut_at.unwrap_or(Time::MAX))
            .min(self.poll_at);
        let most = limit.instructions - self.counted;
        self.bus.stop = (stop, most);
        // Stop after every instruction of code in flash during a flash operation: such code runs on from the prefetch
        // buffer until it stalls. Do the same in the NMI's handler, because its line is tested when it returns.
        self.stirred = false;
        let busy = self.bus.soc.flash.busy_until().is_some();
        self.bus.busy = busy;
        let nmi = self.bus.soc.rcc.nmi();
        self.bus.halt = nmi || busy && self.is_flash(self.pc());
        if let Some(exit) = self.enter_exception() {
            return exit;
        }
        let mut until = self.bus.clock.cycle_at(self.next_event().min(stop));
        let (mut count, mut pc) = (self.core.retired(), self.pc());
        loop {
            if !self.bus.clock.goes_on(count, pc) {
                if pc >= RAM_BASE {
                    let offset = (pc - RAM_BASE) as usize;
                    self.ram_code
                        .runs(offset, &mut *self.core, &self.bus.soc.ram);
                }
                self.follow(count, pc);
            }
            let budget = self
                .bus
                .clock
                .instructions_to(count, until)
                .min(most.saturating_sub(count));
            let budget = if self.bus.halt { 1 } else { budget.max(1) };
            let exit = self.core.run(budget as u32, &mut self.bus).0;
            let before = count;
            (count, pc) = (self.core.retired(), self.pc());
            if busy {
                self.bus.soc.flash.ran(count - before);
            }
            if let Some(segment) = self.bus.clock.ended(count) {
                let (end, after) = (segment.end, segment.after());
                self.charge_end(end, after, pc);
            }
            if exit != Exit::Budget {
                self.unsettled = true;
                return exit;
            }
            // Code in SRAM that returns to flash stalls there.
            let stalls = busy && self.is_flash(pc);
            if self.bus.halt || stalls || !self.bus.queued.is_empty() || count >= most {
                return exit;
            }
            if core::mem::take(&mut self.bus.touched) {
                until = self.bus.clock.cycle_at(self.next_event().min(stop));
            }
            if self.bus.clock.cycle(count) >= until {
                return exit;
            }
        }
    }

    /// Lets the core enter a pending exception without executing an instruction, so that the entry is charged
    /// separately. Returns `None` when no exception is entered and the core can run.
    fn enter_exception(&mut self) -> Option<Exit> {
        if !core::mem::take(&mut self.unsettled) && self.bus.queued.is_empty() {
            return None;
        }
        let before = self.pc();
        let exit = self.core.run(0, &mut self.bus).0;
        if self.pc() != before {
            self.note_active();
            self.bus.clock.charge(self.bus.segments.pace().entry());
            return Some(Exit::Returned);
        }
        (exit != Exit::Budget).then_some(exit)
    }

    /// Selects the segment at `pc`, which the core executes after instruction number `count`. Outside the memories the
    /// segment is empty.
    fn follow(&mut self, count: u64, pc: u32) {
        let bus = &mut self.bus;
        let flash = bus.flash_offset(pc);
        let (memory, offset, changes) = match flash {
            Some(offset) => (bus.soc.flash.bytes(), offset, Some(bus.soc.flash.changes())),
            None => (bus.soc.ram.bytes(), pc.wrapping_sub(RAM_BASE), None),
        };
        let code = memory.get(offset as usize..).unwrap_or_default();
        let place = Place {
            start: pc,
            in_flash: flash.is_some(),
            branched: self.sequential != Some(pc),
        };
        bus.clock
            .follow(count, bus.segments.at(place, code, changes));
    }

    /// Charges the cycles of a segment's last instruction that depend on where it has led. The next instruction is at
    /// `pc`; `after` is the address after the segment.
    fn charge_end(&mut self, end: End, after: u32, pc: u32) {
        self.sequential = (pc == after).then_some(pc);
        let pace = *self.bus.segments.pace();
        let cycles = match end {
            End::Sequential => 0,
            End::Return if self.active.number != 0 => match self.leave(pc) {
                Left::Not => self.branched(after, pc),
                Left::Return => pace.exit(),
                Left::TailChain => pace.tail_chain(),
            },
            End::Exception => {
                if pc == after {
                    0
                } else {
                    self.note_active();
                    pace.entry()
                }
            }
            End::Branch | End::Return => self.branched(after, pc),
        };
        self.bus.clock.charge(cycles);
    }

    fn branched(&self, after: u32, pc: u32) -> u32 {
        let pace = self.bus.segments.pace();
        if pc != after {
            pace.taken(self.is_flash(pc))
        } else if self.is_flash(pc) {
            pace.not_taken()
        } else {
            0
        }
    }

    /// Returns whether a branch to `pc` has ended the active exception.
    fn leave(&mut self, pc: u32) -> Left {
        let was = self.active;
        let number = self.exception();
        if number == was.number {
            return if pc == was.handler {
                Left::TailChain
            } else {
                Left::Not
            };
        }
        self.note_active();
        if number != 0 && pc == self.active.handler {
            Left::TailChain
        } else {
            Left::Return
        }
    }

    /// Returns the number of the active exception.
    fn exception(&self) -> u32 {
        self.register(XPSR).unwrap_or_default() & IPSR
    }

    /// Records a change of the active exception.
    fn note_active(&mut self) {
        let number = self.exception();
        let now = VirtualNanos(self.cycles());
        let table = self.core.debugger_access(None, VTOR, Width::W32, now);
        let at = table.unwrap_or(0) as u32 + 4 * number;
        let word = |bytes: &[u8], base: u32| {
            let at = at.checked_sub(base)? as usize;
            let bytes = bytes.get(at..at + 4)?;
            Some(u32::from_le_bytes(bytes.try_into().ok()?))
        };
        let flash = self.bus.soc.flash.bytes();
        let handler = word(self.bus.soc.ram.bytes(), RAM_BASE)
            .or_else(|| word(flash, FLASH_BASE))
            .or_else(|| word(flash, 0))
            .unwrap_or_default();
        self.active = Active {
            number,
            handler: handler & !1,
        };
        if number == HARD_FAULT {
            self.look_for_breakpoint();
        }
    }

    /// Reports a hard fault whose cause is BKPT. Semihosting, which is BKPT as well, was reported before.
    fn look_for_breakpoint(&mut self) {
        let link = self.register(LR).unwrap_or_default();
        let stack = self.register(if link & SPSEL == 0 { MSP } else { PSP });
        let address = stack.and_then(|stack| self.word(stack.wrapping_add(RETURN_ADDRESS)));
        let Some(address) = address else { return };
        let code = self.half(address);
        if code.is_some_and(|code| code & 0xFF00 == 0xBE00 && code != 0xBEAB) {
            let what = What::Other(BREAKPOINT);
            self.bus.findings.add(self.now(), address, what);
        }
    }
}

/// Effect of a branch on the active exception.
enum Left {
    /// None: the branch stays within the handler.
    Not,
    /// The branch returned from the exception.
    Return,
    /// Another exception, or the same one again, follows immediately.
    TailChain,
}
