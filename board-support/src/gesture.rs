//! The gesture that starts recovery on a board without SW01, as SW01 = 255 does on the others. It counts within five
//! seconds of a power-on only, so no reset in service changes the address.

use crate::pin::Pin;

/// A gesture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gesture {
    /// A switch is moved twice.
    Moved(Pin),
    /// A button, which connects its pin to ground, is held from power-on and released after two seconds or more.
    Held(Pin),
}

impl Gesture {
    /// Returns the pin of the switch or button.
    #[must_use]
    pub const fn pin(self) -> Pin {
        match self {
            Self::Moved(pin) | Self::Held(pin) => pin,
        }
    }
}

/// Time after power-on within which the gesture must end, in ms.
const END_MS: u32 = 5_000;
/// Least time for which a button must be held, in ms.
const HELD_MS: u32 = 2_000;
/// Time after which a level counts, in ms.
const BOUNCE_MS: u32 = 30;

/// The state of a gesture.
#[derive(Clone, Copy, Debug)]
pub struct Watch {
    gesture: Gesture,
    /// The last level, and when it was seen first.
    level: bool,
    since: u32,
    /// The last level that counted.
    counted: Option<bool>,
    moves: u8,
}

impl Watch {
    /// Waits for a gesture from power-on.
    #[must_use]
    pub const fn new(gesture: Gesture) -> Self {
        Self {
            gesture,
            level: false,
            since: 0,
            counted: None,
            moves: 0,
        }
    }

    /// Returns the pin of the switch or button.
    #[must_use]
    pub const fn pin(&self) -> Pin {
        self.gesture.pin()
    }

    /// Takes the level of the pin at `now` milliseconds after power-on. Call this every 10 ms or so. Returns whether the
    /// gesture has just ended.
    pub fn step(&mut self, now: u32, high: bool) -> bool {
        if now > END_MS + 1_000 {
            // For good, also when the milliseconds have wrapped.
            self.moves = u8::MAX;
        }
        if high != self.level || self.counted.is_none() && self.since == 0 {
            (self.level, self.since) = (high, now.max(1));
        }
        if now.wrapping_sub(self.since) < BOUNCE_MS || self.counted == Some(high) {
            return false;
        }
        let moved = self.counted.replace(high).is_some();
        if !moved || self.since > END_MS {
            return false;
        }
        self.moves = self.moves.saturating_add(1);
        match self.gesture {
            Gesture::Moved(_) => self.moves == 2,
            Gesture::Held(_) => self.moves == 1 && high && self.since >= HELD_MS,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns when the gesture ends, if the level is that of the last of these times in ms that has passed.
    fn end(gesture: Gesture, levels: &[(u32, bool)]) -> Option<u32> {
        let mut watch = Watch::new(gesture);
        let level = |now| levels.iter().rfind(|(from, _)| *from <= now).unwrap().1;
        let mut ends = (0..10_000)
            .step_by(10)
            .filter(|now| watch.step(*now, level(*now)));
        let end = ends.next();
        assert_eq!(ends.next(), None, "a gesture ends once");
        end
    }

    #[test]
    fn switch_moved_twice_within_five_seconds_is_the_gesture_from_either_side() {
        let moved = Gesture::Moved(Pin::b(2));
        for first in [false, true] {
            let twice = |a, b| end(moved, &[(0, first), (a, !first), (b, first)]);
            assert_eq!(twice(1_000, 2_000), Some(2_030));
            assert_eq!(twice(4_000, 5_000), Some(5_030));
            assert_eq!(twice(4_000, 5_010), None, "too late");
            assert_eq!(twice(1_000, 1_020), None, "it bounces");
            assert_eq!(end(moved, &[(0, first), (1_000, !first)]), None, "once");
        }
    }

    #[test]
    fn third_move_does_not_end_the_gesture_again() {
        let levels = [(0, true), (500, false), (1_000, true), (1_500, false)];
        assert_eq!(end(Gesture::Moved(Pin::b(2)), &levels), Some(1_030));
    }

    #[test]
    fn button_held_from_power_on_for_two_to_five_seconds_is_the_gesture() {
        let held = Gesture::Held(Pin::b(8));
        let released = |at| end(held, &[(0, false), (at, true)]);
        assert_eq!(released(1_990), None, "too short");
        assert_eq!(released(2_000), Some(2_030));
        assert_eq!(released(5_000), Some(5_030));
        assert_eq!(released(5_010), None, "too long");
        let later = [(0, true), (500, false), (3_000, true)];
        assert_eq!(end(held, &later), None, "pressed after power-on");
        let again = [(0, false), (1_000, true), (1_500, false), (4_000, true)];
        assert_eq!(end(held, &again), None, "released and pressed again");
    }

    #[test]
    fn switch_moved_twice_when_the_milliseconds_have_wrapped_is_no_gesture() {
        let mut watch = Watch::new(Gesture::Moved(Pin::b(2)));
        let start = (0..6_000).step_by(10);
        assert!(!start.fold(false, |ends, now| ends | watch.step(now, false)));
        // 49.7 days later.
        let mut ends = false;
        for ms in (0..5_000_u32).step_by(10) {
            let now = ms.wrapping_sub(1_000);
            ends |= watch.step(now, (2_000..3_000).contains(&ms));
        }
        assert!(!ends);
    }

    #[test]
    fn button_that_is_pressed_before_the_milliseconds_wrap_and_released_after_is_no_gesture() {
        let mut watch = Watch::new(Gesture::Held(Pin::b(8)));
        let start = (0..6_000).step_by(10);
        assert!(!start.fold(false, |ends, now| ends | watch.step(now, true)));
        let mut ends = false;
        for ms in (0..6_000_u32).step_by(10) {
            let now = ms.wrapping_sub(1_000);
            ends |= watch.step(now, !(500..4_000).contains(&ms));
        }
        assert!(!ends);
    }
}
