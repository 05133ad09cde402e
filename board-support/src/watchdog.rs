//! The independent watchdog. It resets the device when it is not refreshed, even when the main clock has stopped.
//! It runs from the first steps of a start.

use cortex_m::interrupt;
use stm32f1xx_hal::pac::{self, iwdg::pr::PR as Prescaler};

use crate::{
    design::{WATCHDOG_RELOAD, WATCHDOG_SETTINGS_US, WATCHDOG_START_RELOAD},
    flash,
    wait::within_us,
};

/// Keys for the register KR (RM0008 19.4.1).
const RELOAD: u16 = 0xAAAA;
const OPEN: u16 = 0x5555;
const START: u16 = 0xCCCC;

/// The watchdog, running until the next reset.
pub struct Watchdog {
    iwdg: pac::IWDG,
}

impl Watchdog {
    /// Starts the watchdog with the long period for the start-up,
    /// [`WATCHDOG_START_MS`](crate::design::WATCHDOG_START_MS), so that a start that hangs is reset, too. The
    /// watchdog stops while a debugger halts the core.
    pub(crate) fn start(iwdg: pac::IWDG, debug: &pac::DBGMCU) -> Self {
        Self::started(iwdg, debug, Prescaler::DivideBy32, WATCHDOG_START_RELOAD)
    }

    /// The same, with the period of the loader, [`WATCHDOG_LOADER_MS`](crate::design::WATCHDOG_LOADER_MS).
    #[cfg(feature = "loader")]
    pub(crate) fn start_loader(iwdg: pac::IWDG, debug: &pac::DBGMCU) -> Self {
        let reload = crate::design::WATCHDOG_LOADER_RELOAD;
        Self::started(iwdg, debug, Prescaler::DivideBy128, reload)
    }

    #[inline(always)]
    fn started(iwdg: pac::IWDG, debug: &pac::DBGMCU, divider: Prescaler, reload: u16) -> Self {
        debug.cr().modify(|_, w| w.dbg_iwdg_stop().set_bit());
        let mut watchdog = Self { iwdg };
        // Starting the watchdog also turns the LSI on, which is needed to accept the settings.
        watchdog.write_key(START);
        watchdog.write_key(OPEN);
        watchdog.iwdg.pr().write(|w| w.pr().variant(divider));
        watchdog.iwdg.rlr().write(|w| w.rl().set(reload));
        watchdog.reload_when_set();
        watchdog
    }

    /// Sets the period of the running device: from now on the watchdog must be refreshed every
    /// [`WATCHDOG_MS`](crate::design::WATCHDOG_MS) milliseconds.
    pub fn arm(&mut self) {
        // `start` has waited until PVU and RVU are clear, so PR and RLR may be written (RM0008 19.4.4).
        self.write_key(OPEN);
        self.iwdg.pr().write(|w| w.pr().divide_by16());
        self.iwdg.rlr().write(|w| w.rl().set(WATCHDOG_RELOAD));
        self.reload_when_set();
        flash::watch_erases();
    }

    /// Waits until the settings are in force, then reloads the counter. An earlier reload would use the old value.
    fn reload_when_set(&mut self) {
        within_us(WATCHDOG_SETTINGS_US, || {
            let busy = self.iwdg.sr().read();
            busy.pvu().bit_is_clear() && busy.rvu().bit_is_clear()
        });
        self.refresh();
    }

    /// Refreshes the watchdog.
    pub fn refresh(&mut self) {
        // No erase comes between the two.
        interrupt::free(|_| {
            self.write_key(RELOAD);
            flash::allow_erase();
        });
    }

    fn write_key(&mut self, key: u16) {
        // SAFETY: any value may be written to the key register; three values have an effect.
        self.iwdg.kr().write(|w| unsafe { w.key().bits(key) });
    }
}
