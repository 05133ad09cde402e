//! Accounts for the core's time: running, stalled, asleep or off.

use crate::time::Time;

/// The virtual time of the core by its state. The sum of the fields is all of the time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CoreTime {
    /// Time in which the core executed instructions, also a branch to itself.
    pub running: Time,
    /// Time in which the core waited for the end of a flash operation, to fetch its next instruction.
    pub stalled: Time,
    /// Time in WFI or WFE.
    pub asleep: Time,
    /// Time without power or clock, in reset, or locked up.
    pub off: Time,
}

impl CoreTime {
    /// Returns the times since `earlier`, an earlier reading of the same board.
    #[must_use]
    pub fn since(self, earlier: Self) -> Self {
        Self {
            running: self.running - earlier.running,
            stalled: self.stalled - earlier.stalled,
            asleep: self.asleep - earlier.asleep,
            off: self.off - earlier.off,
        }
    }

    /// Returns the load of the core, 0 to 1: the share of its time that it was not asleep, without the time that it was
    /// off. 0 if it was always off.
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

/// Reason why the core executes no instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rest {
    /// As [`CoreTime::stalled`].
    Stalled,
    /// As [`CoreTime::asleep`].
    Asleep,
    /// As [`CoreTime::off`].
    Off,
    /// The core executes a branch to itself, which the simulator skips.
    Spinning,
}

/// Times so far in which the core has executed no instruction.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Resting(CoreTime);

impl Resting {
    /// Adds a time `span` without instructions.
    pub(super) fn add(&mut self, why: Rest, span: Time) {
        match why {
            Rest::Stalled => self.0.stalled += span,
            Rest::Asleep => self.0.asleep += span,
            Rest::Off => self.0.off += span,
            Rest::Spinning => {}
        }
    }

    /// Returns the times of the core up to `now`.
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
    fn rest_of_the_time_is_running_and_load_ignores_the_time_off() {
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
