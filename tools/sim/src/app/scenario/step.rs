//! The steps of a scenario.

use sim::Time;

use super::super::action::Action;

/// A step of a scenario. It is carried out once in every round.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Time from the start of the round.
    pub at: Time,
    /// Number of the board on the bus, from 0.
    pub board: usize,
    /// What the step does.
    pub deed: Deed,
}

/// What a step does.
#[derive(Clone, Debug, PartialEq)]
pub enum Deed {
    /// Applies an action.
    Act(Action),
    /// Switches the power off, and on again 100 ms later.
    Cycle,
    /// Moves the voltage at an analog input linearly to another value.
    Ramp(Ramp),
}

/// A ramp of an analog input.
#[derive(Clone, Debug, PartialEq)]
pub struct Ramp {
    /// The analog input.
    pub input: Input,
    /// Final voltage at the pin, in mV.
    pub to: u16,
    /// Duration of the ramp.
    pub over: Time,
    /// Start time and start voltage in mV, once the ramp has begun.
    pub begun: Option<(Time, u16)>,
}

/// An analog input of a board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// Port of the slot; `None` means the first slot.
    pub port: Option<u8>,
    /// Number of the channel, 1 to 4.
    pub channel: usize,
}

impl Ramp {
    /// Returns the voltage at `now` in mV.
    pub fn at(&self, now: Time) -> u16 {
        let (begin, from) = self.begun.unwrap_or((now, self.to));
        let passed = now.saturating_sub(begin);
        if passed >= self.over {
            return self.to;
        }
        let share = passed.as_ps() as f64 / self.over.as_ps() as f64;
        (f64::from(from) + (f64::from(self.to) - f64::from(from)) * share).round() as u16
    }

    /// Returns the virtual time at which the ramp ends; `None` before it has begun.
    pub fn end(&self) -> Option<Time> {
        self.begun.map(|(begin, _)| begin + self.over)
    }
}
