//! The debugger's access to the core: breakpoints, single steps, registers, the system control space.

use rigless::soc::Width;
use rigless::time::VirtualNanos;

use super::{Limit, Machine, Stop};
use crate::soc::Circuit;
use crate::time::Time;

/// The system control space (PM0056 4): NVIC, SCB and SysTick.
const SCS: core::ops::Range<u32> = 0xE000_E000..0xE000_F000;

/// A step over a sleep that nothing ends gives up after this long.
const STEP_LIMIT: Time = Time::from_secs(1);

impl<C: Circuit> Machine<C> {
    /// Adds a breakpoint: a run with breakpoints ends before the instruction at `address`. The memory is not changed.
    /// The breakpoint is removed after as many removals as additions.
    pub fn add_breakpoint(&mut self, address: u32) {
        self.debugged = true;
        self.core.add_breakpoint(u64::from(address & !1));
    }

    /// Reverts one [`Machine::add_breakpoint`].
    pub fn remove_breakpoint(&mut self, address: u32) {
        self.core.remove_breakpoint(u64::from(address & !1));
    }

    /// The next instruction is executed even when there is a breakpoint on it.
    pub fn pass_breakpoint(&mut self) {
        let pc = self.core.pc();
        self.core.pass_breakpoint(pc);
    }

    /// Executes one instruction, without taking an interrupt unless the core sleeps.
    pub fn step_instruction(&mut self) -> Stop {
        let asleep = self.core.waiting();
        self.debugged = true;
        self.core.hold_interrupts(!asleep);
        self.pass_breakpoint();
        let stop = self.run(Limit {
            time: self.now() + STEP_LIMIT,
            instructions: self.instructions().saturating_add(1),
            pc: None,
            breakpoints: false,
        });
        self.core.hold_interrupts(false);
        stop
    }

    /// Writes a core register, numbered as for [`Machine::register`]; false when there is none.
    pub fn set_register(&mut self, number: usize, value: u32) -> bool {
        self.core.set_gdb_register(number, &value.to_le_bytes())
    }

    /// Returns the byte at `address` of the system control space, read without a side effect; `None` elsewhere.
    pub fn system_control(&mut self, address: u32) -> Option<u8> {
        if !SCS.contains(&address) {
            return None;
        }
        let now = VirtualNanos(self.cycles());
        let word = u64::from(address & !3);
        let word = self.core.debugger_access(None, word, Width::W32, now)?;
        Some((word >> (8 * (address & 3))) as u8)
    }
}
