//! Scenarios (`--scenario`): changes of the boards' surroundings at exact instants of virtual time, from a TOML file.

use std::collections::BTreeMap;
use std::path::Path;

use sim::Time;
use sim::chip::CYCLE;

mod file;
mod step;
#[cfg(test)]
mod tests;

use super::action::{Action, Change};
pub use file::Known;
pub use step::Input;
use step::{Deed, Ramp, Step};

/// Interval between two changes of a ramp.
const RAMP_STEP: Time = Time::from_ms(10);

/// A scenario and its pending steps.
#[derive(Debug, Default)]
pub struct Scenario {
    steps: Vec<Step>,
    repeat: Option<Time>,
    /// Pending steps with the number of their board, by time and order of queueing.
    due: BTreeMap<(Time, u64), (usize, Deed)>,
    /// Number of steps that were queued so far.
    queued: u64,
    /// Start of the next round.
    round: Option<Time>,
}

impl Scenario {
    /// Reads the scenario in the file at `path`, for these boards.
    ///
    /// # Errors
    ///
    /// The first error in the file and its place, in one line.
    pub fn read(path: &Path, boards: &[Known]) -> Result<Self, String> {
        let in_file = |what: String| format!("{}: {what}", path.display());
        let text = std::fs::read_to_string(path).map_err(|error| in_file(error.to_string()))?;
        Self::parse(&text, boards).map_err(in_file)
    }

    fn parse(text: &str, boards: &[Known]) -> Result<Self, String> {
        let (steps, repeat) = file::parse(text, boards)?;
        Ok(Self {
            steps,
            repeat,
            round: Some(Time::ZERO),
            ..Self::default()
        })
    }

    /// Returns the time of the next step.
    pub fn next(&self) -> Option<Time> {
        let due = self.due.first_key_value().map(|(&(at, _), _)| at);
        due.into_iter().chain(self.round).min()
    }

    /// Returns the next action that is due at `now`, and the number of its board. `millivolts` returns the voltage at
    /// the pin of an analog input in mV, at which a ramp starts.
    pub fn take(
        &mut self,
        now: Time,
        millivolts: impl Fn(usize, Input) -> Option<u16>,
    ) -> Option<(usize, Action)> {
        self.begin_round(now);
        let first = self
            .due
            .first_entry()
            .filter(|first| first.key().0 <= now)?;
        let (board, deed) = first.remove();
        let action = match deed {
            Deed::Act(action) => action,
            Deed::Cycle => {
                self.queue(now + CYCLE, board, Deed::Act(Action::PowerOn));
                Action::PowerOff
            }
            Deed::Ramp(mut ramp) => {
                let Input { port, channel } = ramp.input;
                if ramp.begun.is_none() {
                    let from = millivolts(board, ramp.input).unwrap_or(ramp.to);
                    ramp.begun = Some((now, from));
                }
                let change = Change::Millivolts(ramp.at(now));
                self.go_on(now, board, ramp);
                Action::Channel {
                    port,
                    channel,
                    change,
                }
            }
        };
        Some((board, action))
    }

    /// Queues the next change of a ramp that has not ended.
    fn go_on(&mut self, now: Time, board: usize, ramp: Ramp) {
        if let Some(end) = ramp.end().filter(|end| *end > now) {
            self.queue((now + RAMP_STEP).min(end), board, Deed::Ramp(ramp));
        }
    }

    /// Queues the steps of each round that has begun at `now`.
    fn begin_round(&mut self, now: Time) {
        while let Some(begin) = self.round.filter(|begin| *begin <= now) {
            for step in self.steps.clone() {
                self.queue(begin + step.at, step.board, step.deed);
            }
            self.round = self.repeat.map(|repeat| begin + repeat);
        }
    }

    fn queue(&mut self, at: Time, board: usize, deed: Deed) {
        self.queued += 1;
        self.due.insert((at, self.queued), (board, deed));
    }
}
