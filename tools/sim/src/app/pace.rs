//! Keeps virtual time in step with the wall clock.

use std::time::{Duration, Instant};

use sim::Time;

/// So far may virtual time fall behind before it stops trying to catch up: after the machine slept, or
/// was too slow, a master gets its answers late, but not after a burst of seconds gone by.
const CATCH_UP: Duration = Duration::from_millis(200);

/// A pair of instants at which both clocks stood together.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    wall: Instant,
    virtual_time: Time,
}

impl Pace {
    /// Both clocks stand together now.
    pub fn new(wall: Instant, virtual_time: Time) -> Self {
        Self { wall, virtual_time }
    }

    /// Where virtual time, standing at `at`, should be by the wall clock.
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

/// A span of the wall clock in virtual time.
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
    fn a_long_sleep_is_not_made_up_for() {
        let begin = Instant::now();
        let mut pace = Pace::new(begin, Time::ZERO);
        let awake = begin + Duration::from_secs(3600);
        assert_eq!(pace.target(awake, Time::from_ms(5)), Time::from_ms(205));
        // From there on in step again.
        let next = awake + Duration::from_millis(10);
        assert_eq!(pace.target(next, Time::from_ms(205)), Time::from_ms(215));
    }
}
