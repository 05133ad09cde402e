//! The orders that change the boot state while the application runs. Each has a record to write, and takes effect once
//! that record is in flash.

use register_map::update::{Reason, Slot, State};

use crate::{Image, Record};

/// An order that changes the boot state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// COMMAND 0xB001: take a new image into the slot that does not run.
    Prepare,
    /// COMMAND 0xB002: what was received is whole and its CRC-32 is right, so the loader checks it at the next start.
    Finish,
    /// COMMAND 0xB003: keep the running image.
    Confirm,
    /// COMMAND 0xB004: start the other image on trial. Its CRC-32 is right.
    GoBack,
}

/// The state does not allow the order: exception 06.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refused;

/// What an order changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    /// The slot whose state changes.
    pub slot: Slot,
    /// Its state.
    pub state: State,
    /// The order costs one of the saves that a master has. Without a limit, a loop of such orders and the starts behind
    /// them would wear the pages of the boot state out.
    pub costs_a_save: bool,
}

/// The boot state as the running application sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Running {
    /// The record in force.
    pub record: Record,
    /// The slot that the application runs from.
    pub slot: Slot,
    /// [`Order::Prepare`] was given in this run of the application: the other slot takes blocks.
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

    /// Returns the record after an order. `image` is what the order is about: the running one for [`Order::Confirm`],
    /// for any other the one in the other slot.
    ///
    /// # Errors
    ///
    /// - [`Order::Confirm`] when the image is below the floor or by a revoked key, which only a last resort is.
    /// - Any other order while the running image is not confirmed.
    /// - [`Order::Finish`] when the slot holds neither the blocks of this run nor an image whose check or trial ended
    ///   without a verdict.
    /// - [`Order::GoBack`] when the image is not confirmed, below the floor, or by a revoked key.
    pub fn after(&self, order: Order, image: Image) -> Result<Record, Refused> {
        let Change { slot, state, .. } = self.change(order, image)?;
        let mut record = self.record.with(slot, state);
        if order == Order::Confirm {
            record.prefer(slot, image);
        }
        Ok(record)
    }

    /// Returns what an order changes.
    ///
    /// # Errors
    ///
    /// As [`Self::after`].
    pub fn change(&self, order: Order, image: Image) -> Result<Change, Refused> {
        let other = self.other();
        let allowed = self.record.allows(image);
        let (may, state, costs_a_save) = match order {
            Order::Confirm if allowed => {
                return Ok(Change {
                    slot: self.slot,
                    state: State::Confirmed,
                    costs_a_save: false,
                });
            }
            Order::Confirm => (false, State::Empty, false),
            Order::Prepare => (true, State::Receiving, true),
            // The 0xB001 before the blocks has cost one.
            Order::Finish if other == State::Receiving => (true, State::New, false),
            Order::Finish => (is_repeated(other), State::New, true),
            Order::GoBack => (allowed && other == State::Confirmed, State::Trial(0), true),
        };
        if may && self.is_confirmed() {
            Ok(Change {
                slot: self.slot.other(),
                state,
                costs_a_save,
            })
        } else {
            Err(Refused)
        }
    }
}

/// Returns whether a slot in this state holds an image whose check or trial ended without a verdict.
const fn is_repeated(state: State) -> bool {
    matches!(
        state,
        State::Rejected(Reason::Interrupted | Reason::NotConfirmed)
    )
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use register_map::update::TRIALS;

    use super::*;

    const FLOOR: u16 = 5;
    const ORDERS: [Order; 4] = [Order::Prepare, Order::Finish, Order::Confirm, Order::GoBack];

    fn states() -> Vec<State> {
        let codes = (0..=u8::MAX).flat_map(|code| (0..=u8::MAX).map(move |detail| (code, detail)));
        codes
            .filter_map(|(code, detail)| State::from_code(code, detail))
            .collect()
    }

    /// Returns every unit that runs from slot B, with a bit that only a newer image knows.
    fn units() -> Vec<(Running, [State; 2])> {
        let mut units = Vec::new();
        for other in states() {
            for own in [State::Trial(TRIALS), State::Confirmed] {
                for (prepared, bits) in [(false, 0x80), (true, 0x80), (false, 0x82)] {
                    let states = [other, own];
                    let record = Record {
                        preferred: Slot::A,
                        states,
                        floor: FLOOR,
                        bits,
                    };
                    let running = Running {
                        record,
                        slot: Slot::B,
                        prepared,
                    };
                    units.push((running, states));
                }
            }
        }
        units
    }

    /// Returns every image that may lie beside the floor.
    fn images() -> Vec<Image> {
        let epochs = [FLOOR - 1, FLOOR, FLOOR + 1];
        epochs
            .into_iter()
            .flat_map(|epoch| [false, true].map(|by_second| Image { epoch, by_second }))
            .collect()
    }

    #[test]
    fn orders_change_the_other_slot_and_are_refused_in_every_other_state() {
        for (running, [other, own]) in units() {
            for image in images() {
                let is = |order, may: bool, state: State| {
                    let wanted = running.record.with(Slot::A, state);
                    let wanted = if may && own == State::Confirmed {
                        Ok(wanted)
                    } else {
                        Err(Refused)
                    };
                    assert_eq!(running.after(order, image), wanted, "{running:?}");
                };
                is(Order::Prepare, true, State::Receiving);
                let whole = match other {
                    State::Receiving => running.prepared,
                    State::Rejected(reason) => [9, 10].contains(&(reason as u8)),
                    _ => false,
                };
                is(Order::Finish, whole, State::New);
                let revoked = running.record.bits == 0x82;
                let allowed = image.epoch >= FLOOR && (image.by_second || !revoked);
                is(
                    Order::GoBack,
                    allowed && other == State::Confirmed,
                    State::Trial(0),
                );
            }
        }
    }

    #[test]
    fn confirming_prefers_the_slot_never_lowers_the_floor_and_ends_the_first_key() {
        for (running, [other, _]) in units() {
            for image in images() {
                let confirmed = running.after(Order::Confirm, image);
                let was = running.record.bits;
                if image.epoch < FLOOR || was == 0x82 && !image.by_second {
                    assert_eq!(confirmed, Err(Refused), "{running:?} {image:?}");
                    continue;
                }
                let wanted = Record {
                    preferred: Slot::B,
                    states: [other, State::Confirmed],
                    floor: FLOOR.max(image.epoch),
                    bits: if image.by_second { 0x82 } else { was },
                };
                assert_eq!(confirmed, Ok(wanted));
            }
        }
    }

    /// Each order and the start behind it write the boot state, whose pages would wear out.
    #[test]
    fn order_that_is_possible_again_and_again_costs_a_save() {
        let genuine = Image {
            epoch: FLOOR,
            by_second: false,
        };
        for (running, _) in units() {
            for order in ORDERS {
                let (Ok(record), Ok(change)) = (
                    running.after(order, genuine),
                    running.change(order, genuine),
                ) else {
                    continue;
                };
                let again = Running { record, ..running };
                let is_one_way = match order {
                    // Needs blocks, and they need 0xB001.
                    Order::Finish => running.other() == State::Receiving,
                    Order::Confirm => again.after(order, genuine) == Ok(record),
                    Order::Prepare | Order::GoBack => false,
                };
                assert_eq!(change.costs_a_save, !is_one_way, "{running:?} {order:?}");
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
