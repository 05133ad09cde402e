//! The communication watchdog: sets outputs to SAFE when the line is silent for too long.

/// Measures the time since the last valid request for this unit, including broadcasts.
///
/// All times are milliseconds since the start, wrapping.
#[derive(Debug, Default)]
pub struct CommWatchdog {
    /// Time when the silence began.
    since: u32,
    /// Outputs were set to SAFE in this silence.
    safe: bool,
    tripped: bool,
}

/// Longest time after its end at which a request is reported, in ms: the largest LORA_FRAME_GAP is 500.
const LATEST_MS: u32 = 1_000;

impl CommWatchdog {
    /// Returns a watchdog that has not tripped; the silence begins at the start.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            since: 0,
            safe: false,
            tripped: false,
        }
    }

    /// Restarts the silence: a valid request ended at `at`, at most [`LATEST_MS`] ago.
    pub const fn refresh(&mut self, at: u32) {
        // The lines report the end of a request after different times, so a later one may have been reported before.
        if self.since.wrapping_sub(at) > LATEST_MS {
            self.since = at;
        }
        self.safe = false;
    }

    /// Checks the silence at the time `now`; `timeout_ms` is `None` while the watchdog is off. Returns true once
    /// per silence, when it has reached the time-out.
    pub const fn check(&mut self, now: u32, timeout_ms: Option<u32>) -> bool {
        let Some(timeout_ms) = timeout_ms else {
            // While the watchdog is off, restart the silence, so that it counts from when the watchdog is switched
            // on.
            self.refresh(now);
            return false;
        };
        // When an earlier call was late, a request may have ended after `now`, so the difference can be negative.
        let silent_ms = now.wrapping_sub(self.since).cast_signed();
        if self.safe || silent_ms < timeout_ms.cast_signed() {
            return false;
        }
        self.safe = true;
        self.tripped = true;
        true
    }

    /// Returns whether the silence has reached the time-out and still lasts.
    #[must_use]
    pub const fn has_expired(&self) -> bool {
        self.safe
    }

    /// Returns whether the watchdog has tripped since the start or the last [`clear`](Self::clear).
    #[must_use]
    pub const fn has_tripped(&self) -> bool {
        self.tripped
    }

    /// Clears the flag. Outputs do not change.
    pub const fn clear(&mut self) {
        self.tripped = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the time at which the watchdog trips when it is checked every millisecond after `now`.
    fn trips_at(watchdog: &mut CommWatchdog, now: u32, timeout_ms: u32) -> u32 {
        (now + 1..now + 10_000)
            .find(|now| watchdog.check(*now, Some(timeout_ms)))
            .unwrap()
    }

    #[test]
    fn it_trips_once_per_silence_and_the_flag_stays_set() {
        let mut watchdog = CommWatchdog::new();
        assert_eq!(trips_at(&mut watchdog, 0, 100), 100);
        assert!((101..1000).all(|now| !watchdog.check(now, Some(100))));
        assert!(watchdog.has_expired());
        watchdog.refresh(1000);
        assert!(!watchdog.has_expired());
        assert!(watchdog.has_tripped(), "a request does not clear the flag");
        assert_eq!(trips_at(&mut watchdog, 1000, 100), 1100);
        watchdog.clear();
        assert!(!watchdog.has_tripped());
        assert!((1101..2000).all(|now| !watchdog.check(now, Some(100))));
    }

    #[test]
    fn the_silence_counts_from_the_end_of_the_request() {
        let mut watchdog = CommWatchdog::new();
        watchdog.refresh(1000);
        assert_eq!(trips_at(&mut watchdog, 1033, 100), 1100);
        watchdog.refresh(2000);
        assert_eq!(
            trips_at(&mut watchdog, 2100, 10),
            2101,
            "the silence had already been longer"
        );
    }

    #[test]
    fn a_late_check_measures_exactly_the_silence() {
        let mut watchdog = CommWatchdog::new();
        watchdog.refresh(1000);
        assert!(!watchdog.check(1090, Some(100)));
        // Nothing could be checked for 40 ms; a request ended in the middle of them.
        watchdog.refresh(1110);
        assert!(!watchdog.check(1130, Some(100)));
        assert_eq!(trips_at(&mut watchdog, 1130, 100), 1210);
        watchdog.refresh(1300);
        assert!(watchdog.check(1440, Some(100)));
    }

    #[test]
    fn a_request_that_is_reported_late_does_not_lengthen_the_silence() {
        let mut watchdog = CommWatchdog::new();
        watchdog.refresh(1_400);
        watchdog.refresh(1_000);
        assert_eq!(trips_at(&mut watchdog, 1_450, 100), 1_500);
        watchdog.refresh(1_700);
        assert_eq!(trips_at(&mut watchdog, 1_750, 100), 1_800);
        // The difference of two times that are far apart is not taken for a late report.
        let mut watchdog = CommWatchdog::new();
        watchdog.refresh(3_000_000_000);
        assert_eq!(trips_at(&mut watchdog, 3_000_000_000, 100), 3_000_000_100);
    }

    #[test]
    fn the_time_may_wrap() {
        let mut watchdog = CommWatchdog::new();
        watchdog.refresh(u32::MAX - 2_000);
        watchdog.refresh(u32::MAX - 9);
        assert!(!watchdog.check(89, Some(100)));
        assert!(watchdog.check(90, Some(100)));
    }

    #[test]
    fn requests_prevent_a_trip_and_the_silence_counts_from_switching_on() {
        let mut watchdog = CommWatchdog::new();
        for n in 0..100 {
            assert!((0..100).all(|ms| !watchdog.check(100 * n + ms, Some(100))));
            watchdog.refresh(100 * (n + 1));
        }
        assert!((10_000..11_000).all(|now| !watchdog.check(now, None)));
        assert_eq!(trips_at(&mut watchdog, 10_999, 100), 11_099);
    }
}
