//! Whether the unit answers, and which values are fresh.

use std::time::Duration;

use tokio::time::Instant;

use crate::failure::Failure;

/// Time by which a value may be older than two rounds of polling.
const GRACE: Duration = Duration::from_millis(500);

/// How the unit has answered.
#[derive(Clone, Debug)]
pub struct Link {
    /// When the last round of polling was complete.
    answered: Instant,
    /// Why the last round failed; `None` when it did not.
    trouble: Option<Failure>,
    /// Longest time for which a value counts as fresh.
    limit: Duration,
    every: Duration,
}

/// How the unit answers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum State {
    /// It does.
    Answers,
    /// Nothing is received.
    NoAnswer(Duration),
    /// What is received cannot be read.
    Garbled(Duration),
    /// The port or the connection is lost.
    PortLost(Duration),
    /// Something else than a modio answers, or the unit refuses to say what it is.
    Refuses(Duration),
}

impl Link {
    /// A link to a unit that has answered just now.
    #[must_use]
    pub fn new(now: Instant, every: Duration) -> Self {
        Self {
            answered: now,
            trouble: None,
            limit: every * 2 + GRACE,
            every,
        }
    }

    /// Notes that a round of polling is complete.
    pub fn answered(&mut self, now: Instant, took: Duration) {
        self.answered = now;
        self.trouble = None;
        self.limit = self.every.max(took) * 2 + GRACE;
    }

    /// Notes that a round failed.
    pub fn failed(&mut self, failure: Failure) {
        self.trouble = Some(failure);
    }

    /// Returns why the last round failed.
    #[must_use]
    pub const fn trouble(&self) -> Option<&Failure> {
        self.trouble.as_ref()
    }

    /// Returns how the unit answers.
    #[must_use]
    pub fn state(&self, now: Instant) -> State {
        let since = now.saturating_duration_since(self.answered);
        match &self.trouble {
            None if since <= self.limit => State::Answers,
            None | Some(Failure::NoAnswer(_)) => State::NoAnswer(since),
            Some(Failure::Garbled(_)) => State::Garbled(since),
            Some(Failure::Port(_)) => State::PortLost(since),
            Some(Failure::Refused(_) | Failure::Usage(_)) => State::Refuses(since),
        }
    }

    /// Returns whether a value that was read at this time is fresh. `extra` is for values that are read seldom.
    #[must_use]
    pub fn is_fresh(&self, at: Instant, now: Instant, extra: Duration) -> bool {
        let age = now.saturating_duration_since(at);
        self.trouble.is_none() && age <= self.limit + extra
    }

    /// Returns the longest pause between two values of a line in the chart.
    #[must_use]
    pub const fn limit(&self) -> Duration {
        self.limit
    }
}

/// Returns a duration for people: `12 s`, `3 min`, `2 h`.
#[must_use]
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
    fn value_is_stale_after_a_failure_and_without_news() {
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
