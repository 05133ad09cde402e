//! The power of the part, and its resets.

use rigless::emulator::Queued;
use rigless::soc::Width;

use super::dwt::Dwt;
use super::execute::Active;
use super::{Chip, Cut};
use crate::periph::dbgmcu::Dbgmcu;
use crate::periph::rcc::Cause;
use crate::soc::Circuit;
use crate::time::Time;

/// From the supply's rise to the end of reset: DS5319 table 11, tRSTTEMPO, typical.
const POWER_ON_RESET: Time = Time::from_us(2_500);
/// The shortest reset pulse (RM0008 7.1.1).
const RESET_PULSE: Time = Time::from_us(20);

impl<C: Circuit> Chip<C> {
    /// Switches the power on. Does nothing if it is on.
    pub fn power_on(&mut self) {
        if self.powered {
            return;
        }
        self.powered = true;
        self.power_ons += 1;
        self.keep_ram_code();
        fill_with_noise(self.bus.soc.ram.bytes_mut(), self.power_ons);
        self.bus.dbgmcu = Dbgmcu::new(self.bus.part.idcode);
        self.bus.dwt = Dwt::default();
        self.bus.soc.set_power(true, self.now());
        self.reset_by(Cause::PowerOn);
        self.resets = 0;
    }

    /// Switches the power off at this instant, between two instructions. This may be in the middle of a flash
    /// operation. The contents of the SRAM are lost.
    pub fn power_off(&mut self) {
        if !self.powered {
            return;
        }
        let now = self.now();
        self.bus.advance(now, self.core.retired());
        self.log.poll(self.bus.soc.ram.bytes_mut());
        self.powered = false;
        self.locked_up = false;
        self.cut = None;
        self.cut_at = None;
        self.bus.soc.set_power(false, now);
        self.bus.soc.signals.reset = None;
    }

    /// Returns whether the power is on.
    #[must_use]
    pub fn powered(&self) -> bool {
        self.powered
    }

    /// Returns the number of times that the power was switched on.
    #[must_use]
    pub fn power_ons(&self) -> u64 {
        self.power_ons
    }

    /// Cuts the power in the `nth` flash operation (page erase, mass erase or half-word) from now (1 = the next), when
    /// `fraction` (0 to 1) of the operation is done. A power cut before that cancels this order.
    pub fn cut_in_flash_operation(&mut self, nth: u64, fraction: f64) {
        self.cut = Some(Cut {
            operation: self.bus.soc.flash.started() + nth.max(1),
            fraction: fraction.clamp(0.0, 1.0),
        });
    }

    /// Resets the part through its reset pin. Does nothing while the power is off.
    pub fn reset(&mut self) {
        if self.powered {
            self.reset_by(Cause::Pin);
        }
    }

    /// Resets the whole part.
    pub(super) fn reset_by(&mut self, cause: Cause) {
        let now = self.now();
        self.log.reset(self.bus.soc.ram.bytes_mut());
        self.bus.soc.reset(cause, now);
        let count = self.core.retired();
        self.counted += count;
        self.bus.clock.restart_count(count);
        self.core
            .load(&self.fresh)
            .expect("the state the same core saved");
        self.keep_ram_code();
        let vectors = self.bus.soc.flash.bytes();
        let word = |address: u64, _: Width| {
            let at = address as usize;
            let bytes = vectors.get(at..at + 4)?;
            Some(u64::from(u32::from_le_bytes(bytes.try_into().ok()?)))
        };
        self.core.boot(0, &word);
        if let Some(waits) = &mut self.bus.waits {
            waits.reset(&mut *self.core);
        }
        // The core knows no line level any more.
        self.bus
            .queued
            .retain(|queued| !matches!(queued, Queued::Line(..)));
        self.bus.soc.repeat_lines();
        self.bus.update_rate(0);
        self.active = Active::default();
        self.unsettled = true;
        self.stirred = true;
        self.locked_up = false;
        self.resets = self.resets.saturating_add(1);
        let pulse = if cause == Cause::PowerOn {
            POWER_ON_RESET
        } else {
            RESET_PULSE
        };
        self.held_until = now + pulse;
    }

    /// Returns the number of resets since power-on: by the watchdog, by software or by the pin.
    #[must_use]
    pub fn resets(&self) -> u32 {
        self.resets
    }

    /// Keeps what was translated from SRAM, for a start that copies the same code there.
    fn keep_ram_code(&mut self) {
        if self.bus.waits.is_none() {
            self.ram_code.reset(&mut *self.core, &self.bus.soc.ram);
        } else {
            // The measurement decides which pages are sent to the bus.
            self.ram_mut();
        }
    }
}

/// Fills the SRAM after power-on with arbitrary bytes, which are the same in every run (xorshift64).
fn fill_with_noise(bytes: &mut [u8], seed: u64) {
    let mut state = 0x9E37_79B9_7F4A_7C15 ^ seed;
    for chunk in bytes.chunks_mut(8) {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        chunk.copy_from_slice(&state.to_le_bytes()[..chunk.len()]);
    }
}
