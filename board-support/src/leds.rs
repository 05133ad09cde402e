//! The three status LEDs.

use stm32f1xx_hal::gpio::{Output, PB8, PB9, PC13, PinState, PushPull};

/// Line activity, fault and running.
pub struct Leds {
    activity: PB8<Output<PushPull>>,
    fault: PB9<Output<PushPull>>,
    run: PC13<Output<PushPull>>,
}

impl Leds {
    pub(crate) fn new(
        activity: PB8<Output<PushPull>>,
        fault: PB9<Output<PushPull>>,
        run: PC13<Output<PushPull>>,
    ) -> Self {
        Self {
            activity,
            fault,
            run,
        }
    }

    /// Shows traffic for this unit.
    pub fn set_activity(&mut self, on: bool) {
        self.activity.set_state(PinState::from(on));
    }

    /// Shows that something is wrong.
    pub fn set_fault(&mut self, on: bool) {
        self.fault.set_state(PinState::from(on));
    }

    /// Shows that the firmware runs. This LED is wired to the supply: low lights it.
    pub fn set_run(&mut self, on: bool) {
        self.run.set_state(PinState::from(!on));
    }
}
