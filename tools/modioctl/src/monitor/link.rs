//! State of the connection, and freshness of values.

use std::time::Duration;

use tokio::time::Instant;

use crate::failure::Failure;

/// Margin by which a value may be older than two rounds of polling.
const GRACE: Duration = Duration::from_millis(500);

/// State of the connection to the unit.
#[derive(Clone, Debug)]
pub struct Link {
    /// Time when the last round of polling was complete.
    answered: Instant,
    /// Failure of the last round; `None` when it succeeded.
    trouble: Option<Failure>,
    /// Age up to which a value counts as fresh.
    limit: Duration,
    every: Duration,
}

/// State of the connection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    Answers,
    /// Nothing is received.
    NoAnswer(Duration),
    /// The received bytes cannot be decoded.
    Garbled(Duration),
    /// The port or the connection is lost.
    PortLost(Duration),
    /// The device is not a modio, or the unit refuses to identify itself.
    Refuses(Duration),
}

impl Link {
    /// Returns a link to a unit that has just answered.
    pub fn new(now: Instant, every: Duration) -> Self {
        Self {
            answered: now,
            trouble: None,
            limit: every * 2 + GRACE,
            every,
        }
    }

    /// Stores that a round of polling is complete.
    pub fn answered(&mut self, now: Instant, took: Duration) {
        self.answered = now;
        self.trouble = None;
        self.limit = self.every.max(took) * 2 + GRACE;
    }

    /// Stores that a round failed.
    pub fn failed(&mut self, failure: Failure) {
        self.trouble = Some(failure);
    }

    /// Returns the failure of the last round.
    pub const fn trouble(&self) -> Option<&Failure> {
        self.trouble.as_ref()
    }

    /// Returns the state of the connection.
    pub fn state(&self, now: Instant) -> State {
        let since = now.saturating_duration_since(self.answered);
        match &self.trouble {
            None if since <= self.limit => State::Answers,
            None | Some(Failure::NoAnswer(_)) => State::NoAnswer(since),
            Some(Failure::Garbled(_)) => State::Garbled(since),
            Some(Failure::Port(_)) => State::PortLost(since),
            Some(Failure::Refused(_) | Failure::Busy(_) | Failure::Usage(_)) => {
                State::Refuses(since)
            }
        }
    }

    /// Returns whether a value that was read at this time is fresh. `extra` is an additional time for values that
    /// are read less often.
    pub fn is_fresh(&self, at: Instant, now: Instant, extra: Duration) -> bool {
        let age = now.saturating_duration_since(at);
        self.trouble.is_none() && age <= self.limit + extra
    }

    /// Returns the longest pause between two values of a line in the chart.
    pub const fn limit(&self) -> Duration {
        self.limit
    }
}

/// Returns a duration for people: `12 s`, `3 min`, `2 h`.
pub fn ago(duration: Duration) -> String {
    match duration.as_secs() {
        seconds @ 0..=119 => format!("{seconds} s"),
        seconds @ 120..=7199 => format!("{} min", seconds / 60),
        seconds => format!("{} h", seconds / 3600),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn value_is_old_after_a_failure_and_without_new_values() {
        let start = Instant::now();
        let at = |millis| start + Duration::from_millis(millis);
        let mut link = Link::new(start, Duration::from_millis(250));
        assert_eq!(link.state(at(1000)), State::Answers);
        assert!(link.is_fresh(start, at(1000), Duration::ZERO));
        assert_eq!(
            link.state(at(1100)),
            State::NoAnswer(Duration::from_millis(1100))
        );
        assert!(!link.is_fresh(start, at(1100), Duration::ZERO));
        link.answered(at(1200), Duration::from_secs(1));
        assert_eq!(link.state(at(3600)), State::Answers, "a slow line");
        link.failed(Failure::Garbled("?".to_owned()));
        assert!(!link.is_fresh(at(1200), at(1300), Duration::ZERO));
        assert_eq!(
            link.state(at(1300)),
            State::Garbled(Duration::from_millis(100))
        );
    }

    #[test]
    fn durations_are_short() {
        let text = |seconds| ago(Duration::from_secs(seconds));
        assert_eq!(
            [text(0), text(119), text(120), text(7200)],
            ["0 s", "119 s", "2 min", "2 h"]
        );
    }
}
