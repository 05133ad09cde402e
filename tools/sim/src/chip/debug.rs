//! The chip under a debugger: it halts, looks, changes and goes on. Time passes only in [`Chip::run_debugged`]
//! and [`Chip::step_instruction`], as in every other run.

use super::{Chip, Error};
use crate::machine::memory::RAM_BASE;
use crate::machine::{Limit, Stop};
use crate::soc::Circuit;
use crate::time::Time;

impl<C: Circuit> Chip<C> {
    /// [`Chip::run_debugged`] halts before the instruction at `address`. The flash is left alone, so the
    /// firmware does not notice. As many removals as additions take it away.
    pub fn add_breakpoint(&mut self, address: u32) {
        self.machine.add_breakpoint(address);
    }

    /// Takes back one [`Chip::add_breakpoint`].
    pub fn remove_breakpoint(&mut self, address: u32) {
        self.machine.remove_breakpoint(address);
    }

    /// The next run executes the next instruction even when there is a breakpoint on it.
    pub fn pass_breakpoint(&mut self) {
        self.machine.pass_breakpoint();
    }

    /// Runs as [`Chip::run_until`] does, or up to a breakpoint; returns whether it has come to one.
    pub fn run_debugged(&mut self, t: Time) -> bool {
        self.run(Limit {
            time: t,
            instructions: u64::MAX,
            pc: None,
            breakpoints: true,
        }) == Stop::Pc
    }

    /// Executes one instruction, on a breakpoint or not, without taking an interrupt. A core that sleeps, or
    /// stalls on the flash, gets the time that it needs to get there, at most a second.
    pub fn step_instruction(&mut self) {
        let now = self.now();
        self.machine.bus.soc.refresh(now);
        self.machine.step_instruction();
        self.sync();
    }

    /// Writes a core register, numbered as for [`Chip::register`].
    ///
    /// # Errors
    ///
    /// [`Error::Range`] when there is no such register.
    pub fn set_register(&mut self, number: usize, value: u32) -> Result<(), Error> {
        if self.machine.set_register(number, value) {
            Ok(())
        } else {
            Err(Error::Range("a core register, 0 to 22"))
        }
    }

    /// Reads memory from `address` on into `bytes`: SRAM, flash (at 0 too) and the system control space, none of
    /// which takes notice. Returns how many bytes it received.
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
    /// [`Error::Range`] when they do not all lie in SRAM; then nothing is written.
    pub fn write_memory(&mut self, address: u32, bytes: &[u8]) -> Result<(), Error> {
        let outside = Error::Range("an address in SRAM");
        let at = address.checked_sub(RAM_BASE).ok_or(outside.clone())? as usize;
        self.ram_mut()
            .get_mut(at..at.saturating_add(bytes.len()))
            .ok_or(outside)?
            .copy_from_slice(bytes);
        Ok(())
    }
}
