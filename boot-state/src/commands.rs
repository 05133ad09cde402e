//! The orders that change the boot state while the application runs. Each returns the record to write; the order takes
//! effect once that record is in flash.

use register_map::update::{Reason, Slot, State};

use crate::Record;

/// The state does not allow the order: exception 06.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refused;

/// The boot state as the running application sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Running {
    /// The record in force.
    pub record: Record,
    /// The slot that the application runs from.
    pub slot: Slot,
    /// [`Self::prepare`] was ordered in this run of the application: the other slot takes blocks.
    pub prepared: bool,
}

impl Running {
    /// Returns whether the running image is confirmed. Until then the other slot is the way back, and must not change.
    #[must_use]
    pub fn is_confirmed(&self) -> bool {
        self.record.state(self.slot) == State::Confirmed
    }

    /// Returns the state of the slot that does not run, as file 2 reports it.
    #[must_use]
    pub fn other(&self) -> State {
        match self.record.state(self.slot.other()) {
            State::Receiving if !self.prepared => State::Empty,
            state => state,
        }
    }

    /// COMMAND 0xB001: take a new image into the slot that does not run.
    ///
    /// # Errors
    ///
    /// While the running image is not confirmed.
    pub fn prepare(&self) -> Result<Record, Refused> {
        self.changed(self.is_confirmed(), State::Receiving)
    }

    /// COMMAND 0xB002: what was received is whole, so the loader checks it at the next start. The caller has found the
    /// CRC-32 right.
    ///
    /// # Errors
    ///
    /// While the running image is not confirmed, and when the slot holds neither the blocks of this run nor an image
    /// whose check or trial ended without a verdict.
    pub fn finish(&self) -> Result<Record, Refused> {
        let may = matches!(
            self.other(),
            State::Receiving | State::Rejected(Reason::Interrupted | Reason::NotConfirmed)
        );
        self.changed(self.is_confirmed() && may, State::New)
    }

    /// COMMAND 0xB003: keep the running image, whose security epoch is `epoch`.
    #[must_use]
    pub fn confirm(&self, epoch: u16) -> Record {
        Record {
            preferred: self.slot,
            floor: self.record.floor.max(epoch),
            ..self.record.with(self.slot, State::Confirmed)
        }
    }

    /// COMMAND 0xB004: start the other image on trial. Its CRC-32 is right, and its security epoch is `epoch`.
    ///
    /// # Errors
    ///
    /// When one of the images is not confirmed, or the epoch of the other one is below the floor.
    pub fn go_back(&self, epoch: u16) -> Result<Record, Refused> {
        let may = self.is_confirmed() && self.other() == State::Confirmed;
        self.changed(may && epoch >= self.record.floor, State::Trial(0))
    }

    fn changed(&self, may: bool, other: State) -> Result<Record, Refused> {
        let record = self.record.with(self.slot.other(), other);
        if may { Ok(record) } else { Err(Refused) }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use register_map::update::TRIALS;

    use super::*;

    fn states() -> Vec<State> {
        let codes = (0..=u8::MAX).flat_map(|code| (0..=u8::MAX).map(move |detail| (code, detail)));
        codes
            .filter_map(|(code, detail)| State::from_code(code, detail))
            .collect()
    }

    /// Returns every unit that runs from slot B, with floor 5.
    fn units() -> impl Iterator<Item = (Running, [State; 2])> {
        states().into_iter().flat_map(|other| {
            [State::Trial(TRIALS), State::Confirmed]
                .into_iter()
                .flat_map(move |own| {
                    [false, true].map(|prepared| {
                        let states = [other, own];
                        let record = Record {
                            preferred: Slot::A,
                            states,
                            floor: 5,
                        };
                        let running = Running {
                            record,
                            slot: Slot::B,
                            prepared,
                        };
                        (running, states)
                    })
                })
        })
    }

    #[test]
    fn orders_change_the_other_slot_and_are_refused_in_every_other_state() {
        for (running, [other, own]) in units() {
            let is = |result: Result<Record, Refused>, may: bool, state: State| {
                let wanted = running.record.with(Slot::A, state);
                let wanted = if may && own == State::Confirmed {
                    Ok(wanted)
                } else {
                    Err(Refused)
                };
                assert_eq!(result, wanted, "{running:?}");
            };
            is(running.prepare(), true, State::Receiving);
            let whole = match other {
                State::Receiving => running.prepared,
                State::Rejected(reason) => [9, 10].contains(&(reason as u8)),
                _ => false,
            };
            is(running.finish(), whole, State::New);
            let confirmed = other == State::Confirmed;
            is(running.go_back(4), false, State::Trial(0));
            is(running.go_back(5), confirmed, State::Trial(0));
        }
    }

    #[test]
    fn confirming_prefers_the_running_slot_and_never_lowers_the_floor() {
        for (running, [other, _]) in units() {
            for (epoch, floor) in [(4, 5), (6, 6)] {
                let wanted = Record {
                    preferred: Slot::B,
                    states: [other, State::Confirmed],
                    floor,
                };
                assert_eq!(running.confirm(epoch), wanted);
            }
        }
    }

    #[test]
    fn blocks_of_an_earlier_run_count_as_nothing() {
        for (running, [other, _]) in units() {
            let lost = other == State::Receiving && !running.prepared;
            let wanted = if lost { State::Empty } else { other };
            assert_eq!(running.other(), wanted);
        }
    }
}
