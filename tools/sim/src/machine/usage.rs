//! Where the core's time goes: running, stalled, asleep or off.

use crate::time::Time;

/// How the core has spent the virtual time. All of it is in one of these.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CoreTime {
    /// Executing instructions, an endless loop on the spot included.
    pub running: Time,
    /// Waiting for a flash operation to end, to fetch the next instruction.
    pub stalled: Time,
    /// In WFI or WFE.
    pub asleep: Time,
    /// Without power or clock, held in reset, or locked up.
    pub off: Time,
}

impl CoreTime {
    /// What of it came after `earlier`, an earlier reading of the same board.
    #[must_use]
    pub fn since(self, earlier: Self) -> Self {
        Self {
            running: self.running - earlier.running,
            stalled: self.stalled - earlier.stalled,
            asleep: self.asleep - earlier.asleep,
            off: self.off - earlier.off,
        }
    }

    /// The core's load: what part of the time that it was on it was not asleep, 0 to 1; 0 when it was not on.
    #[must_use]
    pub fn load(self) -> f64 {
        let awake = self.running + self.stalled;
        let on = awake + self.asleep;
        if on == Time::ZERO {
            return 0.0;
        }
        awake.as_secs_f64() / on.as_secs_f64()
    }
}

/// Why no instruction is executed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rest {
    /// As [`CoreTime::stalled`].
    Stalled,
    /// As [`CoreTime::asleep`].
    Asleep,
    /// As [`CoreTime::off`].
    Off,
    /// It branches to itself, which the core skips over.
    Spinning,
}

/// The time so far without an instruction.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Resting(CoreTime);

impl Resting {
    /// `span` more of it.
    pub(super) fn add(&mut self, why: Rest, span: Time) {
        match why {
            Rest::Stalled => self.0.stalled += span,
            Rest::Asleep => self.0.asleep += span,
            Rest::Off => self.0.off += span,
            Rest::Spinning => {}
        }
    }

    /// All of the time up to `now`.
    pub(super) fn of(self, now: Time) -> CoreTime {
        let CoreTime {
            stalled,
            asleep,
            off,
            ..
        } = self.0;
        CoreTime {
            running: now - stalled - asleep - off,
            ..self.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_time_is_accounted_for_and_the_load_is_of_the_time_on() {
        let mut resting = Resting::default();
        resting.add(Rest::Off, Time::from_ms(10));
        resting.add(Rest::Asleep, Time::from_ms(60));
        resting.add(Rest::Stalled, Time::from_ms(10));
        resting.add(Rest::Spinning, Time::from_ms(5));
        let time = resting.of(Time::from_ms(110));
        assert_eq!(time.running, Time::from_ms(30));
        assert!((time.load() - 0.4).abs() < 1e-12);
        assert_eq!(time.since(time), CoreTime::default());
        assert!(CoreTime::default().load().abs() < 1e-12);
    }
}
