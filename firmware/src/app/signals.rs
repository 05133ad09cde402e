//! Sets the LEDs, once per step of their patterns.

use board_support::Leds;
use firmware::lamps::{Lamps, TICK_MS, Trouble};

/// The LEDs and their patterns.
pub struct Signals {
    leds: Leds,
    lamps: Lamps,
    /// Time when the LEDs were last set, in milliseconds since the start.
    set_at: u32,
    /// A fault that lasts as long as the device runs.
    standing: Trouble,
}

impl Signals {
    pub fn new(leds: Leds, standing: Trouble) -> Self {
        Self {
            leds,
            lamps: Lamps::new(),
            set_at: 0,
            standing,
        }
    }

    /// COMMAND 6: makes all LEDs blink for 10 s.
    pub const fn identify(&mut self) {
        self.lamps.identify();
    }

    /// Sets the LEDs, if their next step is due. `request` is only called then and returns whether a request has
    /// been served since the last call.
    pub fn show(&mut self, millis: u32, module_fails: bool, request: impl FnOnce() -> bool) {
        if millis.wrapping_sub(self.set_at) < u32::from(TICK_MS) {
            return;
        }
        self.set_at = millis;
        let trouble = self.standing.or_module(module_fails);
        let lit = self.lamps.tick(request(), trouble);
        self.leds.set_activity(lit.activity);
        self.leds.set_fault(lit.fault);
        self.leds.set_run(lit.run);
    }
}
