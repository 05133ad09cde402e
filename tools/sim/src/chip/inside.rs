//! What a debug probe sees of the part: memories, registers, the log, and what went wrong.

use super::{Chip, Error};
use crate::finding::Finding;
use crate::machine::memory::{FLASH_BASE, RAM_BASE};
use crate::periph::flash::{Durations, Torn};
use crate::soc::Circuit;
use crate::soc::map::Block;

impl<C: Circuit> Chip<C> {
    /// What the firmware logged over RTT since the last call.
    pub fn take_log(&mut self) -> String {
        self.machine.take_log()
    }

    /// The flash.
    #[must_use]
    pub fn flash(&self) -> &[u8] {
        self.machine.bus.soc.flash.bytes()
    }

    /// The flash, to change.
    ///
    /// # Errors
    ///
    /// [`Error::Powered`] while the power is on.
    pub fn flash_mut(&mut self) -> Result<&mut [u8], Error> {
        if self.powered() {
            return Err(Error::Powered);
        }
        Ok(self.machine.flash_mut())
    }

    /// Overwrites code in flash or SRAM while the part runs, to break the program on purpose. Not a flash
    /// operation: nothing stalls and nothing is checked. What was there before.
    ///
    /// # Errors
    ///
    /// [`Error::Range`] when the bytes do not all lie in flash or SRAM.
    pub fn patch_code(&mut self, address: u32, bytes: &[u8]) -> Result<Vec<u8>, Error> {
        let range = |base: u32| {
            let at = address.checked_sub(base)? as usize;
            Some(at..at.saturating_add(bytes.len()))
        };
        let place = if address >= RAM_BASE {
            range(RAM_BASE).and_then(|range| self.machine.ram_mut().get_mut(range))
        } else {
            range(FLASH_BASE).and_then(|range| self.machine.flash_range_mut(range))
        };
        let place = place.ok_or(Error::Range("an address in flash or SRAM"))?;
        let before = place.to_vec();
        place.copy_from_slice(bytes);
        Ok(before)
    }

    /// Inverts bits of a block's register, as a disturbance of the part does: the register is read, and written
    /// as a store of the core would write it. Nothing is checked.
    pub fn upset(&mut self, block: Block, offset: u32, mask: u32) {
        let now = self.now();
        let soc = &mut self.machine.bus.soc;
        soc.sync(now);
        // What the model has no answer to changes nothing.
        if let Ok(value) = soc.read(block, offset, now) {
            let _ = soc.write(block, offset, value ^ mask, now);
        }
    }

    /// Grows whenever the flash's contents may have changed: when an operation has ended or was torn, or
    /// someone was lent them to change.
    #[must_use]
    pub fn flash_changes(&self) -> u64 {
        self.machine.bus.soc.flash.changes().get()
    }

    /// Flash operations started since the chip was made.
    #[must_use]
    pub fn flash_operations(&self) -> u64 {
        self.machine.bus.soc.flash.started()
    }

    /// How long flash operations take from now on.
    pub fn set_flash_durations(&mut self, durations: Durations) {
        self.machine.bus.soc.flash.durations = durations;
    }

    /// The `nth` flash operation from now (1 = the next) ends without the EOP flag.
    pub fn end_without_eop(&mut self, nth: u64) {
        self.machine.bus.soc.flash.end_without_eop(nth);
    }

    /// What a power cut in the middle of a flash operation leaves from now on.
    pub fn set_torn(&mut self, torn: Torn) {
        self.machine.bus.soc.flash.torn = torn;
    }

    /// The SRAM.
    #[must_use]
    pub fn ram(&self) -> &[u8] {
        self.machine.ram()
    }

    /// The SRAM, to change as a debug probe does: to break something on purpose.
    pub fn ram_mut(&mut self) -> &mut [u8] {
        self.machine.ram_mut()
    }

    /// The word at `address` in flash or SRAM; `None` elsewhere.
    #[must_use]
    pub fn word(&self, address: u32) -> Option<u32> {
        let read = |bytes: &[u8], base: u32| {
            let at = address.checked_sub(base)? as usize;
            let bytes = bytes.get(at..at.checked_add(4)?)?;
            Some(u32::from_le_bytes(bytes.try_into().ok()?))
        };
        read(self.ram(), RAM_BASE).or_else(|| read(self.flash(), FLASH_BASE))
    }

    /// The address of a symbol of the image; a function's has bit 0 set (Thumb).
    #[must_use]
    pub fn symbol(&self, name: &str) -> Option<u32> {
        self.symbols.get(name).copied()
    }

    /// Everything the firmware did that a real part would not take well, since the chip was made.
    #[must_use]
    pub fn findings(&self) -> &[Finding] {
        self.machine.bus.findings.as_slice()
    }

    /// Whether the core has locked up: only a reset gets it out.
    #[must_use]
    pub fn locked_up(&self) -> bool {
        self.machine.locked_up()
    }

    /// Whether the core waits in WFI or WFE.
    #[must_use]
    pub fn asleep(&self) -> bool {
        self.machine.asleep()
    }

    /// The address of the next instruction.
    #[must_use]
    pub fn pc(&self) -> u32 {
        self.machine.pc()
    }

    /// A core register: 0 to 12, 13 SP, 14 LR, 15 PC, 16 xPSR, 17 MSP, 18 PSP, 19 PRIMASK, 20 BASEPRI,
    /// 21 FAULTMASK, 22 CONTROL; `None` above.
    #[must_use]
    pub fn register(&self, number: usize) -> Option<u32> {
        self.machine.register(number)
    }

    /// HCLK in Hz: the cycles that SysTick and DWT count.
    #[must_use]
    pub fn hclk(&self) -> u32 {
        self.machine.bus.soc.rcc.clocks().hclk
    }
}
