//! The status LEDs, set in steps of 10 ms.
//!
//! | LED | pattern |
//! |---|---|
//! | running | blinks once a second |
//! | activity | is lit for 50 ms after a request for this unit, or a broadcast |
//! | fault | blinks five times in two seconds: SW01 is not set to a unit address |
//! | | is lit: a module does not answer |
//! | | is lit for 100 ms every two seconds: the crystal does not run |
//! | | is dark: no fault |
//!
//! After COMMAND 6, identify, all three blink together for 10 s in place of these patterns.
//!
//! A board with one LED shows the pattern of the fault on it, or else that of running. Activity inverts it.

use embedded_hal::digital::{OutputPin, PinState};

use crate::start_up::Address;

/// Interval between two steps of the patterns, in milliseconds.
pub const TICK_MS: u16 = 10;

const PERIOD: u16 = 2000 / TICK_MS;
const BLINK: u16 = 200 / TICK_MS;
const RUN: u16 = 500 / TICK_MS;
const FLASH: u16 = 100 / TICK_MS;
/// Duration of the blinking after [`Leds::identify`], in ticks.
const IDENTIFY: u16 = 10_000 / TICK_MS;
const ACTIVITY: u8 = (50 / TICK_MS) as u8;

/// The most severe known fault. The variants are in order of decreasing severity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// SW01 is not set to a unit address: the line is not served.
    NoAddress,
    /// A module does not answer.
    Module,
    /// The crystal does not run: the clock may be wrong by up to 2.5 %.
    NoCrystal,
    /// No fault.
    None,
}

impl Trouble {
    /// Returns the fault that is known at the start.
    #[must_use]
    pub const fn at_start(address: Address, crystal: bool) -> Self {
        match address {
            Address::Invalid => Self::NoAddress,
            _ if !crystal => Self::NoCrystal,
            _ => Self::None,
        }
    }

    /// Returns the more severe of this fault and a failing module.
    #[must_use]
    pub const fn or_module(self, failing: bool) -> Self {
        match self {
            Self::NoCrystal | Self::None if failing => Self::Module,
            _ => self,
        }
    }
}

/// The LEDs for activity, fault and running, and the state of their patterns.
#[derive(Debug)]
pub struct Leds<P, const N: usize> {
    /// High lights activity and fault. The running LED, which is the last or the only one, is connected to the supply, so
    /// low lights it.
    pins: [P; N],
    /// A fault that lasts as long as the device runs.
    standing: Trouble,
    /// Time when the LEDs were last set, in milliseconds since the start.
    set_at: u32,
    tick: u16,
    /// A request has been served since the last tick.
    requested: bool,
    activity: u8,
    /// Ticks for which all LEDs still blink.
    identify: u16,
}

impl<P, const N: usize> Leds<P, N> {
    /// Starts the patterns. `pins` are those of activity, fault and running, or only that of running.
    #[must_use]
    pub const fn new(pins: [P; N], standing: Trouble) -> Self {
        Self {
            pins,
            standing,
            set_at: 0,
            tick: 0,
            requested: false,
            activity: 0,
            identify: 0,
        }
    }

    /// Makes all LEDs blink together for 10 s from now on; after that they show the state of the device again.
    pub const fn identify(&mut self) {
        self.identify = IDENTIFY;
    }

    /// Returns which LEDs are lit for the next [`TICK_MS`]: activity, fault, running. `request` says that a request
    /// has been served since the last tick.
    fn tick(&mut self, request: bool, module_fails: bool) -> [bool; 3] {
        self.activity = if request {
            ACTIVITY
        } else {
            self.activity.saturating_sub(1)
        };
        let tick = self.tick;
        self.tick = if tick + 1 < PERIOD { tick + 1 } else { 0 };
        if let Some(left) = self.identify.checked_sub(1) {
            self.identify = left;
            // Lit for the first 200 ms, dark for the last 200 ms.
            return [!(left / BLINK).is_multiple_of(2); 3];
        }
        let trouble = self.standing.or_module(module_fails);
        let fault = match trouble {
            Trouble::NoAddress => (tick / BLINK).is_multiple_of(2),
            Trouble::Module => true,
            Trouble::NoCrystal => tick < FLASH,
            Trouble::None => false,
        };
        let (active, run) = (self.activity > 0, (tick / RUN).is_multiple_of(2));
        let last = match trouble {
            _ if N > 1 => run,
            Trouble::None => run != active,
            _ => fault != active,
        };
        [active, fault, last]
    }
}

impl<P: OutputPin, const N: usize> Leds<P, N> {
    /// Sets the LEDs, if their next step is due. `request` says that a request has been served since the last call.
    pub fn show(&mut self, millis: u32, module_fails: bool, request: bool) {
        self.requested |= request;
        if millis.wrapping_sub(self.set_at) < u32::from(TICK_MS) {
            return;
        }
        self.set_at = millis;
        let request = core::mem::take(&mut self.requested);
        let [activity, fault, run] = self.tick(request, module_fails);
        let levels = [activity, fault, !run];
        for (pin, high) in self.pins.iter_mut().zip(levels.into_iter().skip(3 - N)) {
            let _ = pin.set_state(PinState::from(high));
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    const ACTIVE: usize = 0;
    const FAULT: usize = 1;
    const RUNNING: usize = 2;

    /// Returns the milliseconds lit and the number of times switched on in two seconds.
    fn measure(trouble: Trouble, led: usize) -> (u16, usize) {
        let mut leds = Leds::new([(); 3], trouble);
        let lit: Vec<bool> = (0..PERIOD).map(|_| leds.tick(false, false)[led]).collect();
        let rises = (0..lit.len()).filter(|&i| lit[i] && !lit[(i + lit.len() - 1) % lit.len()]);
        let count = lit.iter().filter(|&&on| on).count() as u16;
        (count * TICK_MS, rises.count())
    }

    #[test]
    fn each_trouble_has_its_own_pattern() {
        assert_eq!(measure(Trouble::None, FAULT), (0, 0));
        assert_eq!(measure(Trouble::NoAddress, FAULT), (1000, 5));
        assert_eq!(measure(Trouble::Module, FAULT), (2000, 0));
        assert_eq!(measure(Trouble::NoCrystal, FAULT), (100, 1));
        assert_eq!(measure(Trouble::None, RUNNING), (1000, 2));
    }

    #[test]
    fn only_led_shows_the_fault_or_else_running_and_activity_inverts_it() {
        let lit = |trouble, request| {
            let mut leds = Leds::new([()], trouble);
            let lit = (0..PERIOD).filter(|_| leds.tick(request, false)[RUNNING]);
            lit.count() as u16 * TICK_MS
        };
        assert_eq!(lit(Trouble::None, false), 1000);
        assert_eq!(lit(Trouble::NoCrystal, false), 100);
        assert_eq!(lit(Trouble::NoCrystal, true), 1900);
        assert_eq!(lit(Trouble::Module, false), 2000);
        let mut leds = Leds::new([()], Trouble::None);
        assert!(leds.tick(false, false)[RUNNING] && !leds.tick(true, false)[RUNNING]);
    }

    #[test]
    fn identify_makes_all_leds_blink_together_for_ten_seconds() {
        let mut leds = Leds::new([(); 3], Trouble::Module);
        leds.tick(false, false);
        leds.identify();
        let mut lit = 0;
        for tick in 0..IDENTIFY {
            let on = (tick / BLINK).is_multiple_of(2);
            assert_eq!(leds.tick(false, false), [on; 3], "tick {tick}");
            lit += u16::from(on);
        }
        assert_eq!(lit * TICK_MS, 5000);
        let [activity, fault, _] = leds.tick(false, false);
        assert!(fault && !activity, "the module's fault is shown again");
    }

    #[test]
    fn identify_while_the_leds_blink_restarts_the_ten_seconds() {
        let mut leds = Leds::new([(); 3], Trouble::None);
        leds.identify();
        for _ in 0..IDENTIFY - 1 {
            leds.tick(false, false);
        }
        leds.identify();
        let mut blinking = (0..IDENTIFY).map(|_| leds.tick(false, false)[FAULT]);
        assert_eq!(blinking.by_ref().filter(|fault| *fault).count(), 500);
        assert!(!leds.tick(false, false)[FAULT]);
    }

    #[test]
    fn the_most_severe_trouble_is_shown() {
        let unit = Address::Unit(1);
        assert_eq!(Trouble::at_start(unit, true), Trouble::None);
        assert_eq!(Trouble::at_start(unit, false), Trouble::NoCrystal);
        assert_eq!(
            Trouble::at_start(Address::Invalid, false),
            Trouble::NoAddress
        );
        assert_eq!(Trouble::None.or_module(true), Trouble::Module);
        assert_eq!(Trouble::NoCrystal.or_module(false), Trouble::NoCrystal);
        assert_eq!(Trouble::NoAddress.or_module(true), Trouble::NoAddress);
    }

    #[test]
    fn a_request_lights_the_activity_led_for_fifty_milliseconds() {
        let mut leds = Leds::new([(); 3], Trouble::None);
        assert!(!leds.tick(false, false)[ACTIVE]);
        assert!(leds.tick(true, false)[ACTIVE]);
        for _ in 0..4 {
            assert!(leds.tick(false, false)[ACTIVE]);
        }
        assert!(!leds.tick(false, false)[ACTIVE]);
    }
}
