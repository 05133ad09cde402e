//! The independent watchdog: resets the device when it is not fed, even with the main clock dead.
//! Driven through its registers, because the HAL's panics and waits without a bound.

use stm32f1xx_hal::pac;

use crate::{
    design::{WATCHDOG_RELOAD, WATCHDOG_SETTINGS_US},
    wait::within_us,
};

/// What KR is to be told (RM0008 19.4.1).
const FEED: u16 = 0xAAAA;
const OPEN: u16 = 0x5555;
const START: u16 = 0xCCCC;

/// The watchdog; running once started, until the next reset.
pub struct Watchdog {
    iwdg: pac::IWDG,
}

impl Watchdog {
    /// It stops while a debugger has halted the core.
    pub(crate) fn new(iwdg: pac::IWDG, debug: &pac::DBGMCU) -> Self {
        debug.cr().modify(|_, w| w.dbg_iwdg_stop().set_bit());
        Self { iwdg }
    }

    /// Starts it: from now on it must be fed every [`WATCHDOG_MS`](crate::design::WATCHDOG_MS)
    /// milliseconds.
    pub fn start(&mut self) {
        // Starting also starts the oscillator that the settings are taken over by.
        self.tell(START);
        self.tell(OPEN);
        self.iwdg.pr().write(|w| w.pr().divide_by8());
        self.iwdg.rlr().write(|w| w.rl().set(WATCHDOG_RELOAD));
        within_us(WATCHDOG_SETTINGS_US, || {
            let busy = self.iwdg.sr().read();
            busy.pvu().bit_is_clear() && busy.rvu().bit_is_clear()
        });
        // Should they still not be taken over, the first period is 410 ms instead.
        self.feed();
    }

    /// Feeds it.
    pub fn feed(&mut self) {
        self.tell(FEED);
    }

    fn tell(&mut self, key: u16) {
        // SAFETY: any value may be written to the key register; three of them mean something.
        self.iwdg.kr().write(|w| unsafe { w.key().bits(key) });
    }
}
