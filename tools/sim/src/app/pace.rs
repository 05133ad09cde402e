//! Keeps virtual time in step with the wall clock.

use std::time::{Duration, Instant};

use sim::Time;

/// Most time that virtual time tries to catch up. If it is further behind, because the computer slept or was too slow,
/// the rest of the time is skipped, so that the boards do not run through it in a burst.
const CATCH_UP: Duration = Duration::from_millis(200);

/// An instant of the wall clock and the virtual time at this instant.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    wall: Instant,
    virtual_time: Time,
}

impl Pace {
    /// Pairs an instant of the wall clock with a virtual time.
    pub fn new(wall: Instant, virtual_time: Time) -> Self {
        Self { wall, virtual_time }
    }

    /// Returns the virtual time that belongs to `wall`. Virtual time is at `at` now.
    pub fn target(&mut self, wall: Instant, at: Time) -> Time {
        let target = self.virtual_time + span(wall.saturating_duration_since(self.wall));
        let limit = at + span(CATCH_UP);
        if target <= limit {
            return target;
        }
        *self = Self::new(wall, limit);
        limit
    }
}

/// Span in which [`Speed`] compares virtual time with the wall clock.
const SPAN: Duration = Duration::from_secs(10);
/// A span that is longer is not judged: the process was stopped, or the computer slept.
const STOPPED: Duration = Duration::from_secs(15);
/// Percentage of the wall clock that is too slow.
const SLOW: u128 = 80;

/// Notices a computer that is too slow for the boards.
#[derive(Clone, Copy, Debug)]
pub struct Speed {
    begin: Pace,
    has_told: bool,
}

impl Speed {
    /// Begins at an instant of the wall clock and of virtual time.
    pub fn new(wall: Instant, virtual_time: Time) -> Self {
        Self {
            begin: Pace::new(wall, virtual_time),
            has_told: false,
        }
    }

    /// Begins again at this instant.
    pub fn restart(&mut self, wall: Instant, virtual_time: Time) {
        self.begin = Pace::new(wall, virtual_time);
    }

    /// Returns the speed in percent, once, when it is too low.
    pub fn too_low(&mut self, wall: Instant, virtual_time: Time) -> Option<u128> {
        let passed = wall.saturating_duration_since(self.begin.wall);
        if self.has_told || passed < SPAN {
            return None;
        }
        let ran = (virtual_time - self.begin.virtual_time).as_ns();
        let percent = u128::from(ran) * 100 / passed.as_nanos();
        self.restart(wall, virtual_time);
        self.has_told = passed < STOPPED && percent < SLOW;
        self.has_told.then_some(percent)
    }
}

/// Returns a span of the wall clock in virtual time.
pub fn span(duration: Duration) -> Time {
    Time::from_ns(u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn virtual_time_follows_the_wall_clock() {
        let begin = Instant::now();
        let mut pace = Pace::new(begin, Time::from_ms(100));
        for ms in [0, 1, 7, 150] {
            let at = Time::from_ms(100);
            let target = pace.target(begin + Duration::from_millis(ms), at);
            assert_eq!(target, Time::from_ms(100 + ms));
        }
    }

    #[test]
    fn computer_that_is_too_slow_is_reported_once() {
        let begin = Instant::now();
        let mut speed = Speed::new(begin, Time::ZERO);
        let mut at =
            |wall, board| speed.too_low(begin + Duration::from_secs(wall), Time::from_secs(board));
        assert_eq!(at(9, 1), None, "the span is not over");
        assert_eq!(at(10, 9), None, "fast enough");
        assert_eq!(at(100, 10), None, "the process was stopped");
        assert_eq!(at(110, 15), Some(50));
        assert_eq!(at(120, 20), None, "told before");
    }

    #[test]
    fn time_lost_in_a_long_sleep_is_skipped() {
        let begin = Instant::now();
        let mut pace = Pace::new(begin, Time::ZERO);
        let awake = begin + Duration::from_secs(3600);
        assert_eq!(pace.target(awake, Time::from_ms(5)), Time::from_ms(205));
        // Virtual time then follows the wall clock again.
        let next = awake + Duration::from_millis(10);
        assert_eq!(pace.target(next, Time::from_ms(205)), Time::from_ms(215));
    }
}
