//! The steps of a scenario.

use sim::Time;

use super::super::action::Action;

/// A step, which happens once in every round.
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
    /// Moves an analog input evenly to another voltage.
    Ramp(Ramp),
}

/// A ramp of an analog input.
#[derive(Clone, Debug, PartialEq)]
pub struct Ramp {
    /// The input.
    pub input: Input,
    /// Final voltage at the pin, in mV.
    pub to: u16,
    /// Duration.
    pub over: Time,
    /// Start time and start voltage in mV, once the ramp has begun.
    pub begun: Option<(Time, u16)>,
}

/// A channel of a board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// The port of its slot; the first slot without it.
    pub port: Option<u8>,
    /// Its number, 1 to 4.
    pub channel: usize,
}

impl Ramp {
    /// Voltage at `now` in mV.
    pub fn at(&self, now: Time) -> u16 {
        let (begin, from) = self.begun.unwrap_or((now, self.to));
        let passed = now.saturating_sub(begin);
        if passed >= self.over {
            return self.to;
        }
        let share = passed.as_ps() as f64 / self.over.as_ps() as f64;
        (f64::from(from) + (f64::from(self.to) - f64::from(from)) * share).round() as u16
    }

    /// Time of its end, once the ramp has begun.
    pub fn end(&self) -> Option<Time> {
        self.begun.map(|(begin, _)| begin + self.over)
    }
}
