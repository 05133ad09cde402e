//! The independent watchdog: resets the device when it is not fed, even with the main clock dead.

use stm32f1xx_hal::{pac, time::MilliSeconds, watchdog::IndependentWatchdog};

use crate::design::WATCHDOG_MS;

/// The watchdog; running once started, until the next reset.
pub struct Watchdog {
    iwdg: IndependentWatchdog,
}

impl Watchdog {
    pub(crate) fn new(iwdg: pac::IWDG, debug: &pac::DBGMCU) -> Self {
        let iwdg = IndependentWatchdog::new(iwdg);
        iwdg.stop_on_debug(debug, true);
        Self { iwdg }
    }

    /// Starts it: from now on it must be fed every [`WATCHDOG_MS`] milliseconds.
    pub fn start(&mut self) {
        self.iwdg.start(MilliSeconds::millis(WATCHDOG_MS));
    }

    /// Feeds it.
    pub fn feed(&mut self) {
        self.iwdg.feed();
    }
}
