//! Failure and recovery of the crystal while the part runs, with the clock security system (RM0008 7.2.7) and
//! without it.
//!
//! With CSSON, a failure switches the HSE off. If SYSCLK was derived from the HSE, directly or through the PLL, the
//! PLL is switched off too and the HSI replaces it immediately. CSSF then holds the NMI until CSSC is written.
//! Without CSSON there is no replacement: HSERDY is cleared, and a SYSCLK derived from the crystal stops until the
//! crystal recovers or the part is reset. (A real PLL without its input runs at an undefined frequency for a while;
//! that is not modelled.) The break input of TIM1 is not modelled.

use super::{CFGR_SW, CR_CSSON, CR_HSEON, CR_HSION, CR_PLLON, Rcc};
use crate::time::Time;

impl Rcc {
    /// Returns whether the crystal works.
    #[must_use]
    pub fn crystal(&self) -> bool {
        self.crystal
    }

    /// Sets whether the crystal works from `now` on.
    pub fn set_crystal(&mut self, works: bool, now: Time) {
        if works == self.crystal {
            return;
        }
        self.now = now;
        let ran = self.is_ready(self.hse);
        self.crystal = works;
        if works {
            self.come_back(now);
        } else if ran && self.cr & CR_CSSON != 0 {
            self.fail_over(now);
        } else {
            self.die();
        }
        self.changes.clocks = true;
    }

    /// Returns whether the clock security system holds the NMI.
    #[must_use]
    pub fn nmi(&self) -> bool {
        self.failed
    }

    /// Returns whether SYSCLK's source has failed without a replacement.
    #[must_use]
    pub fn stopped(&self) -> bool {
        !self.is_ready(self.source(self.sws))
    }

    /// Returns the instant at which an HSE that is switched on now is ready.
    pub(super) fn hse_start(&self, now: Time) -> Time {
        if self.crystal {
            now + self.oscillators.hse_start
        } else {
            Time::MAX
        }
    }

    /// Handles a failure of the HSE with the clock security system.
    fn fail_over(&mut self, now: Time) {
        self.failed = true;
        if self.hse_in_use() {
            self.cr |= CR_HSION;
            self.hsi.get_or_insert(now);
            if self.sws == 2 {
                self.cr &= !CR_PLLON;
                self.pll = None;
            }
            self.sws = 0;
            self.cfgr &= !CFGR_SW;
        }
        self.cr &= !CR_HSEON;
        self.hse = None;
        self.wait_for_hse(Time::MAX);
    }

    /// Handles a failure of the HSE without the clock security system: the clocks derived from it stop.
    fn die(&mut self) {
        if self.hse.is_some() {
            self.hse = Some(Time::MAX);
        }
        self.wait_for_hse(Time::MAX);
    }

    fn come_back(&mut self, now: Time) {
        if self.hse.is_some() {
            let ready = self.hse_start(now);
            self.hse = Some(ready);
            let lock = self.pll_lock(now);
            self.wait_for_hse(lock);
        }
    }

    /// Sets the instant `lock` at which a PLL that runs from the HSE locks.
    fn wait_for_hse(&mut self, lock: Time) {
        if self.pll_from_hse() {
            self.pll = self.pll.map(|_| lock);
        }
    }
}
