//! Methods for a debugger: breakpoints, single steps, registers and memory. Virtual time passes only in
//! [`Chip::run_debugged`] and [`Chip::step_instruction`].

use rigless::soc::Width;
use rigless::time::VirtualNanos;

use super::{Chip, Limit};
use crate::error::Error;
use crate::memory::RAM_BASE;
use crate::soc::Circuit;
use crate::time::Time;

/// The system control space (PM0056 4): NVIC, SCB and SysTick.
const SCS: core::ops::Range<u32> = 0xE000_E000..0xE000_F000;

/// A step over a sleep that nothing ends gives up after this long.
const STEP_LIMIT: Time = Time::from_secs(1);

impl<C: Circuit> Chip<C> {
    /// Adds a breakpoint: [`Chip::run_debugged`] halts before the instruction at `address`. This does not change the
    /// flash, so the firmware does not notice it. A breakpoint that was added several times must be removed as often.
    pub fn add_breakpoint(&mut self, address: u32) {
        self.debugged = true;
        self.core.add_breakpoint(u64::from(address & !1));
    }

    /// Removes a breakpoint that [`Chip::add_breakpoint`] has added.
    pub fn remove_breakpoint(&mut self, address: u32) {
        self.core.remove_breakpoint(u64::from(address & !1));
    }

    /// Lets the next run execute its first instruction even if there is a breakpoint on it.
    pub fn pass_breakpoint(&mut self) {
        let pc = self.core.pc();
        self.core.pass_breakpoint(pc);
    }

    /// Runs until `t` as [`Chip::run_until`], or to a breakpoint. Returns whether it has reached a breakpoint.
    pub fn run_debugged(&mut self, t: Time) -> bool {
        self.run(Limit {
            breakpoints: true,
            ..Limit::until(t)
        })
    }

    /// Executes one instruction, also at a breakpoint, without taking an interrupt. If the core sleeps or waits for the
    /// flash, time passes until it executes an instruction again, at most one second.
    pub fn step_instruction(&mut self) {
        self.refresh();
        let asleep = self.core.waiting();
        self.debugged = true;
        self.core.hold_interrupts(!asleep);
        self.pass_breakpoint();
        self.run_core(Limit {
            instructions: self.instructions().saturating_add(1),
            ..Limit::until(self.now() + STEP_LIMIT)
        });
        self.core.hold_interrupts(false);
        self.sync();
    }

    /// Writes a core register, numbered as for [`Chip::register`].
    ///
    /// # Errors
    ///
    /// [`Error::Range`] if there is no such register.
    pub fn set_register(&mut self, number: usize, value: u32) -> Result<(), Error> {
        let written = self.core.set_gdb_register(number, &value.to_le_bytes());
        written
            .then_some(())
            .ok_or(Error::Range("core registers are numbered 0 to 22"))
    }

    /// Returns the byte at `address` of the system control space, read without a side effect; `None` elsewhere.
    fn system_control(&mut self, address: u32) -> Option<u8> {
        if !SCS.contains(&address) {
            return None;
        }
        let now = VirtualNanos(self.cycles());
        let word = u64::from(address & !3);
        let word = self.core.debugger_access(None, word, Width::W32, now)?;
        Some((word >> (8 * (address & 3))) as u8)
    }

    /// Reads memory from `address` on into `bytes`: SRAM, flash (also at address 0) and the system control space.
    /// Reading them has no side effect. Returns the number of bytes that were read.
    pub fn read_memory(&mut self, address: u32, bytes: &mut [u8]) -> usize {
        for (n, byte) in (0..).zip(bytes.iter_mut()) {
            let Some(read) = self.byte(address.wrapping_add(n)) else {
                return n as usize;
            };
            *byte = read;
        }
        bytes.len()
    }

    fn byte(&mut self, address: u32) -> Option<u8> {
        let flash = self.bus.flash_offset(address);
        let ram = address.checked_sub(RAM_BASE);
        ram.and_then(|offset| self.ram().get(offset as usize))
            .or_else(|| self.flash().get(flash? as usize))
            .copied()
            .or_else(|| self.system_control(address))
    }

    /// Writes `bytes` to SRAM from `address` on.
    ///
    /// # Errors
    ///
    /// [`Error::Range`] if not all bytes are in SRAM. Nothing is written then.
    pub fn write_memory(&mut self, address: u32, bytes: &[u8]) -> Result<(), Error> {
        let outside = Error::Range("all bytes must be in SRAM");
        let at = address.checked_sub(RAM_BASE).ok_or(outside.clone())? as usize;
        self.ram_mut()
            .get_mut(at..at.saturating_add(bytes.len()))
            .ok_or(outside)?
            .copy_from_slice(bytes);
        Ok(())
    }
}
