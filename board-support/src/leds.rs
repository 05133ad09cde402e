//! The three status LEDs.

use stm32f1xx_hal::gpio::{
    Cr, IOPinSpeed, Output, OutputSpeed, PB8, PB9, PC13, PinState, PushPull,
};

use crate::pin::Port;

/// Bit of PC13 in the registers of port C.
const RUN: u32 = 1 << 13;

/// The LEDs for line activity, fault and running.
pub struct Leds {
    activity: PB8<Output<PushPull>>,
    fault: PB9<Output<PushPull>>,
    /// Changed through port C's registers. The HAL first makes every output a 50 MHz one, but PC13 is limited to 2
    /// MHz and 3 mA (DS5319 table 5, notes).
    _run: PC13,
}

impl Leds {
    /// Turns all LEDs off and selects the slowest edges.
    pub(crate) fn new(
        activity: PB8,
        fault: PB9,
        b: &mut Cr<'B', true>,
        run: PC13,
        _c: &mut Cr<'C', true>,
    ) -> Self {
        let mut activity = activity.into_push_pull_output_with_state(b, PinState::Low);
        activity.set_speed(b, IOPinSpeed::Mhz2);
        let mut fault = fault.into_push_pull_output_with_state(b, PinState::Low);
        fault.set_speed(b, IOPinSpeed::Mhz2);
        let mut leds = Self {
            activity,
            fault,
            _run: run,
        };
        leds.set_run(false);
        Port::C
            .registers()
            .crh()
            .modify(|_, w| w.mode13().output2().cnf13().push_pull());
        leds
    }

    /// Sets the activity LED: traffic for this unit.
    pub fn set_activity(&mut self, on: bool) {
        self.activity.set_state(PinState::from(on));
    }

    /// Sets the fault LED.
    pub fn set_fault(&mut self, on: bool) {
        self.fault.set_state(PinState::from(on));
    }

    /// Sets the running LED. It is connected to the supply, so a low level lights it.
    pub fn set_run(&mut self, on: bool) {
        let bits = if on { RUN << 16 } else { RUN };
        // SAFETY: one store changes PC13 only, which this value owns (RM0008 9.2.5).
        Port::C
            .registers()
            .bsrr()
            .write(|w| unsafe { w.bits(bits) });
    }
}
