//! The lock of a port's configuration, RM0008 9.2.7.

use super::Gpio;

/// LCKK.
const LCKK: u32 = 1 << 16;

impl Gpio {
    /// Returns the bits of CRL (`first` = 0) or CRH (8) that LCKR has frozen.
    pub(super) fn locked(&self, first: u32) -> u32 {
        if self.lckr & LCKK == 0 {
            return 0;
        }
        (0..8)
            .filter(|pin| self.lckr >> (first + pin) & 1 != 0)
            .fold(0, |mask, pin| mask | 0xF << (4 * pin))
    }

    /// LCKR: write 1, write 0, write 1, then read, each with the same pins (RM0008 9.2.7).
    pub(super) fn write_lckr(&mut self, value: u32) {
        if self.lckr & LCKK != 0 {
            return;
        }
        let (pins, key) = (value & 0xFFFF, value & LCKK != 0);
        let same = pins == self.lckr & 0xFFFF;
        self.lock_step = match (self.lock_step, key) {
            (1, false) if same => 2,
            (2, true) if same => 3,
            (_, true) => 1,
            _ => 0,
        };
        self.lckr = pins;
    }

    pub(super) fn read_lckr(&mut self) -> u32 {
        if core::mem::take(&mut self.lock_step) == 3 {
            // The first read still shows LCKK as 0.
            let shown = self.lckr;
            self.lckr |= LCKK;
            return shown;
        }
        self.lckr
    }
}
