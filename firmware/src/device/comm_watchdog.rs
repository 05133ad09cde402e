//! The communication watchdog: when the line falls silent for too long, outputs go to SAFE.

/// Looks at the time since the last valid request for this unit, broadcasts among them.
///
/// All times are milliseconds since the start, wrapping.
#[derive(Debug, Default)]
pub struct CommWatchdog {
    /// When the silence began.
    since: u32,
    /// SAFE has been commanded for this silence.
    safe: bool,
    tripped: bool,
}

impl CommWatchdog {
    /// Not tripped; the silence begins at the start.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            since: 0,
            safe: false,
            tripped: false,
        }
    }

    /// A valid request ended at `at`.
    pub const fn feed(&mut self, at: u32) {
        self.since = at;
        self.safe = false;
    }

    /// The time is `now`; the time-out is in milliseconds, none when it is off. True once a
    /// silence, when it has reached the time-out.
    pub const fn look(&mut self, now: u32, timeout_ms: Option<u32>) -> bool {
        let Some(timeout_ms) = timeout_ms else {
            // Switched on later, it counts from then.
            self.feed(now);
            return false;
        };
        // Of a request that ended after the last look, when this one is late, the time may lie ahead.
        let silent_ms = now.wrapping_sub(self.since).cast_signed();
        if self.safe || silent_ms < timeout_ms.cast_signed() {
            return false;
        }
        self.safe = true;
        self.tripped = true;
        true
    }

    /// Whether it has tripped since the start or the last [`clear`](Self::clear).
    #[must_use]
    pub const fn has_tripped(&self) -> bool {
        self.tripped
    }

    /// Takes the flag back. Outputs stay as they are.
    pub const fn clear(&mut self) {
        self.tripped = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// When it trips, looked at every millisecond after `now`.
    fn trips_at(watchdog: &mut CommWatchdog, now: u32, timeout_ms: u32) -> u32 {
        (now + 1..now + 10_000)
            .find(|now| watchdog.look(*now, Some(timeout_ms)))
            .unwrap()
    }

    #[test]
    fn it_trips_once_a_silence_and_the_flag_stays() {
        let mut watchdog = CommWatchdog::new();
        assert_eq!(trips_at(&mut watchdog, 0, 100), 100);
        assert!((101..1000).all(|now| !watchdog.look(now, Some(100))));
        watchdog.feed(1000);
        assert!(
            watchdog.has_tripped(),
            "a request does not take the flag back"
        );
        assert_eq!(trips_at(&mut watchdog, 1000, 100), 1100);
        watchdog.clear();
        assert!(!watchdog.has_tripped());
        assert!((1101..2000).all(|now| !watchdog.look(now, Some(100))));
    }

    #[test]
    fn the_time_counts_from_the_request_s_end() {
        let mut watchdog = CommWatchdog::new();
        watchdog.feed(1000);
        assert_eq!(trips_at(&mut watchdog, 1033, 100), 1100);
        watchdog.feed(2000);
        assert_eq!(
            trips_at(&mut watchdog, 2100, 10),
            2101,
            "the silence was longer"
        );
    }

    #[test]
    fn a_look_that_is_late_counts_the_whole_silence_and_no_more() {
        let mut watchdog = CommWatchdog::new();
        watchdog.feed(1000);
        assert!(!watchdog.look(1090, Some(100)));
        // For 40 ms nothing could look; a request ended in the middle.
        watchdog.feed(1110);
        assert!(!watchdog.look(1130, Some(100)));
        assert_eq!(trips_at(&mut watchdog, 1130, 100), 1210);
        watchdog.feed(1300);
        assert!(watchdog.look(1440, Some(100)));
    }

    #[test]
    fn time_wraps() {
        let mut watchdog = CommWatchdog::new();
        watchdog.feed(u32::MAX - 9);
        assert!(!watchdog.look(89, Some(100)));
        assert!(watchdog.look(90, Some(100)));
    }

    #[test]
    fn requests_hold_it_off_and_it_counts_from_when_it_is_switched_on() {
        let mut watchdog = CommWatchdog::new();
        for n in 0..100 {
            assert!((0..100).all(|ms| !watchdog.look(100 * n + ms, Some(100))));
            watchdog.feed(100 * (n + 1));
        }
        assert!((10_000..11_000).all(|now| !watchdog.look(now, None)));
        assert_eq!(trips_at(&mut watchdog, 10_999, 100), 11_099);
    }
}
