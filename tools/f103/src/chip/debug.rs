//! Methods for a debugger: breakpoints, single steps, registers and memory. Virtual time passes only in
//! [`Chip::run_debugged`] and [`Chip::step_instruction`].

use super::{Chip, Error};
use crate::machine::memory::RAM_BASE;
use crate::machine::{Limit, Stop};
use crate::soc::Circuit;
use crate::time::Time;

impl<C: Circuit> Chip<C> {
    /// Adds a breakpoint: [`Chip::run_debugged`] halts before the instruction at `address`. This does not change the
    /// flash, so the firmware does not notice it. A breakpoint that was added several times must be removed as often.
    pub fn add_breakpoint(&mut self, address: u32) {
        self.machine.add_breakpoint(address);
    }

    /// Removes a breakpoint that [`Chip::add_breakpoint`] has added.
    pub fn remove_breakpoint(&mut self, address: u32) {
        self.machine.remove_breakpoint(address);
    }

    /// Lets the next run execute its first instruction even if there is a breakpoint on it.
    pub fn pass_breakpoint(&mut self) {
        self.machine.pass_breakpoint();
    }

    /// Runs until `t` as [`Chip::run_until`], or to a breakpoint. Returns whether it has reached a breakpoint.
    pub fn run_debugged(&mut self, t: Time) -> bool {
        self.run(Limit {
            breakpoints: true,
            ..Limit::until(t)
        }) == Stop::Pc
    }

    /// Executes one instruction, also at a breakpoint, without taking an interrupt. If the core sleeps or waits for the
    /// flash, time passes until it executes an instruction again, at most one second.
    pub fn step_instruction(&mut self) {
        self.refresh();
        self.machine.step_instruction();
        self.sync();
    }

    /// Writes a core register, numbered as for [`Chip::register`].
    ///
    /// # Errors
    ///
    /// [`Error::Range`] if there is no such register.
    pub fn set_register(&mut self, number: usize, value: u32) -> Result<(), Error> {
        if self.machine.set_register(number, value) {
            Ok(())
        } else {
            Err(Error::Range("core registers are numbered 0 to 22"))
        }
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
        let flash = self.machine.bus.flash_offset(address);
        let ram = address.checked_sub(RAM_BASE);
        ram.and_then(|offset| self.ram().get(offset as usize))
            .or_else(|| self.flash().get(flash? as usize))
            .copied()
            .or_else(|| self.machine.system_control(address))
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
