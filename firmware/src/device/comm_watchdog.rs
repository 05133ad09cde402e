//! The communication watchdog: when the line falls silent for too long, outputs go to SAFE.

/// Counts the time since the last valid request for this unit, broadcasts among them.
#[derive(Debug, Default)]
pub struct CommWatchdog {
    silent_ms: u32,
    /// SAFE has been commanded for this silence.
    safe: bool,
    tripped: bool,
}

impl CommWatchdog {
    /// Not tripped; the silence begins now.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            silent_ms: 0,
            safe: false,
            tripped: false,
        }
    }

    /// A valid request has come, whose end is so many milliseconds past.
    pub const fn feed(&mut self, passed_ms: u32) {
        self.silent_ms = passed_ms;
        self.safe = false;
    }

    /// A millisecond has passed; the time-out is in milliseconds, none when it is off. True once a
    /// silence, when it reaches the time-out.
    pub const fn tick(&mut self, timeout_ms: Option<u32>) -> bool {
        let Some(timeout_ms) = timeout_ms else {
            // Switched on later, it counts from then.
            self.feed(0);
            return false;
        };
        self.silent_ms = self.silent_ms.saturating_add(1);
        if self.safe || self.silent_ms < timeout_ms {
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

    fn ticks_to_trip(watchdog: &mut CommWatchdog, timeout_ms: u32) -> u32 {
        (1..=10_000)
            .find(|_| watchdog.tick(Some(timeout_ms)))
            .unwrap()
    }

    #[test]
    fn it_trips_once_a_silence_and_the_flag_stays() {
        let mut watchdog = CommWatchdog::new();
        assert_eq!(ticks_to_trip(&mut watchdog, 100), 100);
        assert!((0..1000).all(|_| !watchdog.tick(Some(100))));
        watchdog.feed(0);
        assert!(
            watchdog.has_tripped(),
            "a request does not take the flag back"
        );
        assert_eq!(ticks_to_trip(&mut watchdog, 100), 100);
        watchdog.clear();
        assert!(!watchdog.has_tripped());
        assert!((0..1000).all(|_| !watchdog.tick(Some(100))));
    }

    #[test]
    fn the_time_counts_from_the_request_s_end() {
        let mut watchdog = CommWatchdog::new();
        watchdog.feed(33);
        assert_eq!(ticks_to_trip(&mut watchdog, 100), 67);
        watchdog.feed(100);
        assert_eq!(
            ticks_to_trip(&mut watchdog, 10),
            1,
            "the silence was longer"
        );
    }

    #[test]
    fn requests_hold_it_off_and_it_counts_from_when_it_is_switched_on() {
        let mut watchdog = CommWatchdog::new();
        for _ in 0..100 {
            assert!((0..99).all(|_| !watchdog.tick(Some(100))));
            watchdog.feed(0);
        }
        assert!((0..1000).all(|_| !watchdog.tick(None)));
        assert_eq!(ticks_to_trip(&mut watchdog, 100), 100);
    }
}
