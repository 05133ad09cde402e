//! The LEDs, set once a beat of their patterns.

use board_support::Leds;
use firmware::lamps::{Lamps, TICK_MS, Trouble};

/// The LEDs and what they show.
pub struct Signals {
    leds: Leds,
    lamps: Lamps,
    /// When they were last set, in milliseconds since the start.
    set_at: u32,
    /// What is wrong for as long as the device runs.
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

    /// COMMAND 6: all LEDs blink for a while.
    pub const fn identify(&mut self) {
        self.lamps.identify();
    }

    /// Sets them, if it is time. `request`, asked then alone: has one been served since?
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
