//! The patterns of the status LEDs, in steps of 10 ms.
//!
//! | LED | shows |
//! |---|---|
//! | running | blinks once a second |
//! | activity | lights for 50 ms after a request for this unit |
//! | all three | blink together for 10 s after COMMAND 6, identify, instead of all other patterns |
//! | fault | blinks five times in two seconds: SW01 is not set to a unit address; steady: a module does not answer; a short flash every two seconds: no crystal |

use crate::start_up::Address;

/// Interval between calls of [`Lamps::tick`], in milliseconds.
pub const TICK_MS: u16 = 10;

const PERIOD: u16 = 2000 / TICK_MS;
const BLINK: u16 = 200 / TICK_MS;
const RUN: u16 = 500 / TICK_MS;
const FLASH: u16 = 100 / TICK_MS;
/// Duration of the blinking after [`Lamps::identify`], in ticks.
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

/// Which LEDs are lit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lit {
    /// The activity LED.
    pub activity: bool,
    /// The fault LED.
    pub fault: bool,
    /// The running LED.
    pub run: bool,
}

/// The state of the LEDs' patterns.
#[derive(Debug, Default)]
pub struct Lamps {
    tick: u16,
    activity: u8,
    /// Ticks for which all LEDs still blink.
    identify: u16,
}

impl Lamps {
    /// Starts the patterns.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            tick: 0,
            activity: 0,
            identify: 0,
        }
    }

    /// Makes all LEDs blink together for 10 s from now on; after that they show the state of the device again.
    pub const fn identify(&mut self) {
        self.identify = IDENTIFY;
    }

    /// Returns which LEDs are lit for the next [`TICK_MS`]. `request` says that a request has been served since the
    /// last tick.
    pub fn tick(&mut self, request: bool, trouble: Trouble) -> Lit {
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
            let lit = !(left / BLINK).is_multiple_of(2);
            return Lit {
                activity: lit,
                fault: lit,
                run: lit,
            };
        }
        Lit {
            activity: self.activity > 0,
            fault: match trouble {
                Trouble::NoAddress => (tick / BLINK).is_multiple_of(2),
                Trouble::Module => true,
                Trouble::NoCrystal => tick < FLASH,
                Trouble::None => false,
            },
            run: (tick / RUN).is_multiple_of(2),
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;

    /// Returns the milliseconds lit and the number of times switched on in two seconds.
    fn measure(trouble: Trouble, led: fn(Lit) -> bool) -> (u16, usize) {
        let mut lamps = Lamps::new();
        let lit: Vec<bool> = (0..PERIOD)
            .map(|_| led(lamps.tick(false, trouble)))
            .collect();
        let rises = (0..lit.len()).filter(|&i| lit[i] && !lit[(i + lit.len() - 1) % lit.len()]);
        let count = lit.iter().filter(|&&on| on).count() as u16;
        (count * TICK_MS, rises.count())
    }

    #[test]
    fn each_trouble_has_its_own_pattern() {
        assert_eq!(measure(Trouble::None, |l| l.fault), (0, 0));
        assert_eq!(measure(Trouble::NoAddress, |l| l.fault), (1000, 5));
        assert_eq!(measure(Trouble::Module, |l| l.fault), (2000, 0));
        assert_eq!(measure(Trouble::NoCrystal, |l| l.fault), (100, 1));
        assert_eq!(measure(Trouble::None, |l| l.run), (1000, 2));
    }

    #[test]
    fn identify_makes_all_leds_blink_together_for_ten_seconds() {
        let mut lamps = Lamps::new();
        lamps.tick(false, Trouble::Module);
        lamps.identify();
        let mut lit = 0;
        for tick in 0..IDENTIFY {
            let on = (tick / BLINK).is_multiple_of(2);
            let expected = Lit {
                activity: on,
                fault: on,
                run: on,
            };
            assert_eq!(lamps.tick(false, Trouble::Module), expected, "tick {tick}");
            lit += u16::from(on);
        }
        assert_eq!(lit * TICK_MS, 5000);
        let after = lamps.tick(false, Trouble::Module);
        assert!(
            after.fault && !after.activity,
            "the module's fault is shown again"
        );
    }

    #[test]
    fn identify_while_the_leds_blink_restarts_the_ten_seconds() {
        let mut lamps = Lamps::new();
        lamps.identify();
        for _ in 0..IDENTIFY - 1 {
            lamps.tick(false, Trouble::None);
        }
        lamps.identify();
        let mut blinking = (0..IDENTIFY).map(|_| lamps.tick(false, Trouble::None).fault);
        assert_eq!(blinking.by_ref().filter(|fault| *fault).count(), 500);
        assert!(!lamps.tick(false, Trouble::None).fault);
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
        let mut lamps = Lamps::new();
        assert!(!lamps.tick(false, Trouble::None).activity);
        assert!(lamps.tick(true, Trouble::None).activity);
        for _ in 0..4 {
            assert!(lamps.tick(false, Trouble::None).activity);
        }
        assert!(!lamps.tick(false, Trouble::None).activity);
    }
}
