//! The inside of the part, as with a debug probe: memories, registers, the log and the findings.

use super::{Chip, Error};
use crate::finding::Finding;
use crate::memory::{FLASH_BASE, RAM_BASE};
use crate::periph::flash::{Durations, Torn};
use crate::soc::Circuit;
use crate::soc::map::Block;

impl<C: Circuit> Chip<C> {
    /// Returns the contents of the flash.
    #[must_use]
    pub fn flash(&self) -> &[u8] {
        self.bus.soc.flash.bytes()
    }

    /// Returns the contents of the flash, for changing them.
    ///
    /// # Errors
    ///
    /// [`Error::Powered`] while the power is on.
    pub fn flash_mut(&mut self) -> Result<&mut [u8], Error> {
        if self.powered() {
            return Err(Error::Powered);
        }
        let flash = self.flash_range_mut(0..self.flash().len());
        Ok(flash.unwrap_or_default())
    }

    /// Overwrites code in flash or SRAM while the part runs, to break the program on purpose. This is not a flash
    /// operation: the core does not wait, and nothing is checked. Returns the bytes that were there before.
    ///
    /// # Errors
    ///
    /// [`Error::Range`] if not all bytes are in flash or in SRAM.
    pub fn patch_code(&mut self, address: u32, bytes: &[u8]) -> Result<Vec<u8>, Error> {
        let range = |base: u32| {
            let at = address.checked_sub(base)? as usize;
            Some(at..at.saturating_add(bytes.len()))
        };
        let place = if address >= RAM_BASE {
            range(RAM_BASE).and_then(|range| self.ram_mut().get_mut(range))
        } else {
            range(FLASH_BASE).and_then(|range| self.flash_range_mut(range))
        };
        let place = place.ok_or(Error::Range("all bytes must be in flash or in SRAM"))?;
        let before = place.to_vec();
        place.copy_from_slice(bytes);
        Ok(before)
    }

    /// Inverts the bits `mask` of a block's register, as a disturbance of the part. The register is read, and written
    /// as by a store of the core, but without the checks of the bus.
    pub fn upset(&mut self, block: Block, offset: u32, mask: u32) {
        let now = self.now();
        let soc = &mut self.bus.soc;
        soc.sync(now);
        // A register that is not modelled stays as it is.
        if let Ok(value) = soc.read(block, offset, now) {
            let _ = soc.write(block, offset, value ^ mask, now);
        }
    }

    /// Increases whenever the contents of the flash may have changed: when an operation has ended or was interrupted,
    /// or after [`flash_mut`](Self::flash_mut) and [`patch_code`](Self::patch_code).
    #[must_use]
    pub fn flash_changes(&self) -> u64 {
        self.bus.soc.flash.changes().get()
    }

    /// Returns the number of flash operations that were started since the chip was made.
    #[must_use]
    pub fn flash_operations(&self) -> u64 {
        self.bus.soc.flash.started()
    }

    /// Sets the durations of flash operations from now on.
    pub fn set_flash_durations(&mut self, durations: Durations) {
        self.bus.soc.flash.durations = durations;
    }

    /// Lets the `nth` flash operation from now (1 = the next) end without setting the flag EOP.
    pub fn end_without_eop(&mut self, nth: u64) {
        self.bus.soc.flash.end_without_eop(nth);
    }

    /// Sets the state of cells after a power cut in the middle of a flash operation, from now on.
    pub fn set_torn(&mut self, torn: Torn) {
        self.bus.soc.flash.torn = torn;
    }

    /// Returns the word at `address` in flash or SRAM; `None` at any other address.
    #[must_use]
    pub fn word(&self, address: u32) -> Option<u32> {
        let read = |bytes: &[u8], base: u32| {
            let at = address.checked_sub(base)? as usize;
            let bytes = bytes.get(at..at.checked_add(4)?)?;
            Some(u32::from_le_bytes(bytes.try_into().ok()?))
        };
        read(self.ram(), RAM_BASE).or_else(|| read(self.flash(), FLASH_BASE))
    }

    /// Actions of the firmware since the chip was made that a real part does not allow or the simulator does not model.
    #[must_use]
    pub fn findings(&self) -> &[Finding] {
        self.bus.findings.as_slice()
    }

    /// Returns the frequency of HCLK in Hz. SysTick and DWT count its cycles.
    #[must_use]
    pub fn hclk(&self) -> u32 {
        self.bus.soc.rcc.clocks().hclk
    }
}
