//! The decisions of the loader, in the order in which it makes them at every start.

use register_map::update::{Reason, Slot, State, TRIALS};

use crate::{Image, Record};

/// What the loader needs of the part.
pub trait Part {
    /// Returns whether a slot holds an image whose magic number, bounds, zero bytes and CRC-32 are right.
    fn is_intact(&mut self, slot: Slot) -> bool;

    /// Returns what the header of an intact image says.
    fn image(&mut self, slot: Slot) -> Image;

    /// Checks that the image in a slot is genuine: for this board and this slot, not below the floor, with the right
    /// hash and the signature of a key that is not `revoked`.
    ///
    /// # Errors
    ///
    /// What is wrong with it.
    fn check(&mut self, slot: Slot, floor: u16, revoked: bool) -> Result<(), Reason>;

    /// Writes the boot state.
    ///
    /// # Errors
    ///
    /// When the flash fails. The record before is still in force.
    fn write(&mut self, record: Record) -> Result<(), Unwritten>;
}

/// The boot state could not be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unwritten;

/// Why this start takes place, and what was kept over the reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Start {
    /// COMMAND 2 asked for this restart.
    pub asked: bool,
    /// SW01 was read as 254 at this power-on, and this is the first start after it.
    pub switched: bool,
    /// The slot that SW01 = 254 chose at the last power-on.
    pub chosen: Option<Slot>,
}

/// What the loader does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Next {
    /// Start the image in this slot. A choice is kept over the next reset.
    Run {
        /// The slot.
        slot: Slot,
        /// SW01 = 254 chose this slot.
        chosen: bool,
    },
    /// Reset the part and begin again.
    Reset,
    /// No image can be started.
    Nothing,
}

/// Decides what a start does. Writes the boot state where it changes.
///
/// Nothing is started but an intact image that was found genuine once: *trial* and *confirmed* are reached only through
/// [`Part::check`].
pub fn decide(part: &mut impl Part, record: Option<Record>, start: Start) -> Next {
    let Some(mut record) = record else {
        return first(part);
    };
    match checked(part, &mut record) {
        Ok(false) => {}
        Ok(true) => return Next::Reset,
        Err(Unwritten) => return preferred(part, &record),
    }
    if let Some(slot) = chosen(part, &record, start) {
        return Next::Run { slot, chosen: true };
    }
    match on_trial(part, &mut record, start.asked) {
        Ok(Some(slot)) => Next::Run {
            slot,
            chosen: false,
        },
        Ok(None) | Err(Unwritten) => preferred(part, &record),
    }
}

/// Step 1, without a boot state: a genuine image is confirmed. One by the second key comes before one by the first, then
/// the higher epoch counts, then slot A. So the first key stays revoked while an image by the second is left. When the
/// record cannot be written, the image is started all the same, and found again at the next start.
fn first(part: &mut impl Part) -> Next {
    let [a, b] = Slot::ALL.map(|slot| {
        let image = part.is_intact(slot).then(|| part.image(slot));
        image.map(|image| (image.by_second, image.epoch))
    });
    // What a header says of itself, the check finds true or refuses.
    let slots = if b > a { [Slot::B, Slot::A] } else { Slot::ALL };
    let genuine = |slot: &Slot| part.is_intact(*slot) && part.check(*slot, 0, false).is_ok();
    let Some(slot) = slots.into_iter().find(genuine) else {
        return Next::Nothing;
    };
    let image = part.image(slot);
    let mut record = Record {
        preferred: slot,
        states: [State::Empty; 2],
        floor: 0,
        bits: 0,
    };
    record.prefer(slot, image);
    match part.write(record.with(slot, State::Confirmed)) {
        Ok(()) => Next::Reset,
        Err(Unwritten) => Next::Run {
            slot,
            chosen: false,
        },
    }
}

/// Steps 2 and 3: ends a check that was interrupted, and checks a new image. Returns whether an image was checked.
fn checked(part: &mut impl Part, record: &mut Record) -> Result<bool, Unwritten> {
    for slot in Slot::ALL {
        if record.state(slot) == State::Checking {
            put(part, record, slot, State::Rejected(Reason::Interrupted))?;
        }
    }
    for slot in Slot::ALL {
        if record.state(slot) == State::New {
            put(part, record, slot, State::Checking)?;
            let verdict = match part.check(slot, record.floor, record.is_revoked()) {
                Ok(()) => State::Trial(0),
                Err(reason) => State::Rejected(reason),
            };
            // Without the verdict the next start finds that the check was interrupted.
            let _ = put(part, record, slot, verdict);
            return Ok(true);
        }
    }
    Ok(false)
}

/// Step 4: returns the slot that SW01 = 254 chooses.
fn chosen(part: &mut impl Part, record: &Record, start: Start) -> Option<Slot> {
    let other = start.switched.then(|| record.preferred.other());
    let slot = start.chosen.or(other)?;
    let may = record.state(slot) == State::Confirmed
        && part.is_intact(slot)
        && record.allows(part.image(slot));
    may.then_some(slot)
}

/// Step 5: returns the slot with an image on trial. The trial is counted before the image starts.
fn on_trial(
    part: &mut impl Part,
    record: &mut Record,
    asked: bool,
) -> Result<Option<Slot>, Unwritten> {
    for slot in Slot::ALL {
        let State::Trial(starts) = record.state(slot) else {
            continue;
        };
        if !part.is_intact(slot) {
            put(part, record, slot, State::Rejected(Reason::Crc))?;
        } else if starts >= TRIALS {
            put(part, record, slot, State::Rejected(Reason::NotConfirmed))?;
        } else {
            if !asked {
                put(part, record, slot, State::Trial(starts + 1))?;
            }
            return Ok(Some(slot));
        }
    }
    Ok(None)
}

/// Steps 6 and 7: the preferred slot, else the other one, whatever its epoch and its key.
fn preferred(part: &mut impl Part, record: &Record) -> Next {
    let slots = [record.preferred, record.preferred.other()];
    let may = |slot: &Slot| record.state(*slot) == State::Confirmed && part.is_intact(*slot);
    match slots.into_iter().find(may) {
        Some(slot) => Next::Run {
            slot,
            chosen: false,
        },
        None => Next::Nothing,
    }
}

fn put(
    part: &mut impl Part,
    record: &mut Record,
    slot: Slot,
    state: State,
) -> Result<(), Unwritten> {
    let changed = record.with(slot, state);
    part.write(changed)?;
    *record = changed;
    Ok(())
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::{vec, vec::Vec};

    use super::*;
    use State::{Checking, Confirmed, Empty, New, Rejected, Trial};

    /// A part whose slots hold genuine images of epochs 3 and 4 by the first key, except where a field says otherwise.
    #[derive(Default)]
    struct Genuine {
        damaged: Option<Slot>,
        forged: Option<Slot>,
        refuses: bool,
        /// The slot whose image the second key signed.
        by_second: Option<Slot>,
        written: Vec<[State; 2]>,
        last: Option<Record>,
    }

    impl Part for Genuine {
        fn is_intact(&mut self, slot: Slot) -> bool {
            self.damaged != Some(slot)
        }

        fn image(&mut self, slot: Slot) -> Image {
            Image {
                epoch: 3 + slot as u16,
                by_second: self.by_second == Some(slot),
            }
        }

        fn check(&mut self, slot: Slot, _: u16, revoked: bool) -> Result<(), Reason> {
            if self.forged == Some(slot) || revoked && self.by_second != Some(slot) {
                Err(Reason::Signature)
            } else {
                Ok(())
            }
        }

        fn write(&mut self, record: Record) -> Result<(), Unwritten> {
            if self.refuses {
                return Err(Unwritten);
            }
            self.written.push(record.states);
            self.last = Some(record);
            Ok(())
        }
    }

    /// Returns what a start does with these states, with A preferred and floor 4, and the states that it writes.
    fn start(part: Genuine, states: [State; 2], start: Start) -> (Next, Vec<[State; 2]>) {
        start_with(part, states, start, 0)
    }

    fn start_with(
        mut part: Genuine,
        states: [State; 2],
        start: Start,
        bits: u8,
    ) -> (Next, Vec<[State; 2]>) {
        let record = Record {
            preferred: Slot::A,
            states,
            floor: 4,
            bits,
        };
        let next = decide(&mut part, Some(record), start);
        (next, part.written)
    }

    fn run(slot: Slot) -> Next {
        Next::Run {
            slot,
            chosen: false,
        }
    }

    fn ordinary(states: [State; 2]) -> (Next, Vec<[State; 2]>) {
        start(Genuine::default(), states, Start::default())
    }

    #[test]
    fn new_image_is_checked_and_the_part_is_reset() {
        let checking = [Confirmed, Checking];
        let genuine = (Next::Reset, vec![checking, [Confirmed, Trial(0)]]);
        assert_eq!(ordinary([Confirmed, New]), genuine);
        let forged = Genuine {
            forged: Some(Slot::B),
            ..Genuine::default()
        };
        let rejected = [Confirmed, Rejected(Reason::Signature)];
        assert_eq!(
            start(forged, [Confirmed, New], Start::default()),
            (Next::Reset, vec![checking, rejected])
        );
        let interrupted = [Confirmed, Rejected(Reason::Interrupted)];
        assert_eq!(ordinary(checking), (run(Slot::A), vec![interrupted]));
    }

    #[test]
    fn trial_has_two_starts_and_an_order_does_not_count() {
        let trial = |starts| [Confirmed, Trial(starts)];
        assert_eq!(ordinary(trial(0)), (run(Slot::B), vec![trial(1)]));
        assert_eq!(ordinary(trial(1)), (run(Slot::B), vec![trial(2)]));
        let rejected = [Confirmed, Rejected(Reason::NotConfirmed)];
        assert_eq!(ordinary(trial(2)), (run(Slot::A), vec![rejected]));
        let asked = Start {
            asked: true,
            ..Start::default()
        };
        let part = Genuine::default();
        assert_eq!(start(part, trial(1), asked), (run(Slot::B), vec![]));
        let damaged = Genuine {
            damaged: Some(Slot::B),
            ..Genuine::default()
        };
        let rejected = [Confirmed, Rejected(Reason::Crc)];
        let next = start(damaged, trial(0), Start::default());
        assert_eq!(next, (run(Slot::A), vec![rejected]));
    }

    #[test]
    fn switch_chooses_the_other_slot_and_the_choice_is_kept() {
        let chosen = |slot| Next::Run { slot, chosen: true };
        let switched = Start {
            switched: true,
            ..Start::default()
        };
        let kept = Start {
            chosen: Some(Slot::B),
            ..Start::default()
        };
        for how in [switched, kept] {
            let next = start(Genuine::default(), [Confirmed; 2], how);
            assert_eq!(next, (chosen(Slot::B), vec![]));
            let next = start(Genuine::default(), [Confirmed, Empty], how);
            assert_eq!(next, (run(Slot::A), vec![]));
        }
        // A has an epoch below the floor, and is preferred, which counts more.
        let below = Start {
            chosen: Some(Slot::A),
            ..Start::default()
        };
        let next = start(Genuine::default(), [Confirmed; 2], below);
        assert_eq!(next, (run(Slot::A), vec![]));
    }

    #[test]
    fn revoked_key_signs_nothing_new_and_is_not_chosen_but_starts_as_the_last_resort() {
        let revoked = Record::FIRST_KEY_REVOKED;
        let with = |part, states, how| start_with(part, states, how, revoked);
        let rejected = [Confirmed, Rejected(Reason::Signature)];
        assert_eq!(
            with(Genuine::default(), [Confirmed, New], Start::default()),
            (Next::Reset, vec![[Confirmed, Checking], rejected])
        );
        let switched = Start {
            switched: true,
            ..Start::default()
        };
        let by_second = |slot| Genuine {
            by_second: Some(slot),
            ..Genuine::default()
        };
        let next = with(by_second(Slot::A), [Confirmed; 2], switched);
        assert_eq!(next, (run(Slot::A), vec![]));
        let next = with(by_second(Slot::B), [Confirmed; 2], switched);
        let chosen = Next::Run {
            slot: Slot::B,
            chosen: true,
        };
        assert_eq!(next, (chosen, vec![]));
        let last = Genuine {
            damaged: Some(Slot::A),
            ..Genuine::default()
        };
        let next = with(last, [Confirmed; 2], Start::default());
        assert_eq!(next, (run(Slot::B), vec![]));
    }

    #[test]
    fn first_start_takes_the_second_key_then_the_higher_epoch() {
        for (by_second, slot, floor, bits) in [
            (None, Slot::B, 4, 0),
            (Some(Slot::A), Slot::A, 3, Record::FIRST_KEY_REVOKED),
            (Some(Slot::B), Slot::B, 4, Record::FIRST_KEY_REVOKED),
        ] {
            let mut part = Genuine {
                by_second,
                ..Genuine::default()
            };
            assert_eq!(decide(&mut part, None, Start::default()), Next::Reset);
            let wanted = Record {
                preferred: slot,
                states: [Empty; 2],
                floor,
                bits,
            };
            assert_eq!(part.last, Some(wanted.with(slot, Confirmed)));
        }
    }

    #[test]
    fn first_start_confirms_a_genuine_image_and_no_image_is_nothing() {
        let mut part = Genuine {
            forged: Some(Slot::A),
            ..Genuine::default()
        };
        let next = decide(&mut part, None, Start::default());
        assert_eq!(
            (next, &part.written[..]),
            (Next::Reset, &[[Empty, Confirmed]][..])
        );
        part.refuses = true;
        let next = decide(&mut part, None, Start::default());
        assert_eq!(next, run(Slot::B), "it is started all the same");
        part.damaged = Some(Slot::B);
        assert_eq!(decide(&mut part, None, Start::default()), Next::Nothing);
    }

    #[test]
    fn flash_that_cannot_be_written_starts_the_preferred_image() {
        for states in [
            [Confirmed, Trial(0)],
            [Confirmed, New],
            [Confirmed, Checking],
        ] {
            let part = Genuine {
                refuses: true,
                ..Genuine::default()
            };
            assert_eq!(
                start(part, states, Start::default()),
                (run(Slot::A), vec![])
            );
        }
    }
}
