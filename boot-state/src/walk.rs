//! Walks through every state of a unit that the loader's decisions and the application's orders can reach: every event
//! in each, and a power cut between any two writes.
//!
//! A slot holds one of a few contents, and a record is written whole, because [`journal`](crate::journal) seals it.

extern crate std;
use std::{collections::HashSet, vec, vec::Vec};

use register_map::update::{Reason, Slot, State, TRIALS};

use crate::{
    Image, Record,
    commands::{Order, Running},
    decide::{Next, Part, Start, Unwritten, decide},
};

/// What a slot holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Content {
    /// Nothing, or a part of an image.
    Nothing,
    /// An image whose CRC-32 is right and whose signature is wrong.
    Forged,
    /// A genuine image of this epoch, by this key.
    Genuine(u16, Behaviour, Key),
}
use Content::{Forged, Genuine, Nothing};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Behaviour {
    /// It serves the line.
    Serves,
    /// The watchdog resets it, or it restarts after 15 minutes without an order.
    Fails,
}
use Behaviour::{Fails, Serves};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Key {
    First,
    Second,
}
use Key::{First, Second};

const CONTENTS: [Content; 9] = [
    Nothing,
    Forged,
    Genuine(1, Serves, First),
    Genuine(1, Fails, First),
    Genuine(2, Serves, First),
    Genuine(2, Fails, First),
    Genuine(1, Serves, Second),
    Genuine(2, Serves, Second),
    Genuine(2, Fails, Second),
];

impl Content {
    fn image(self) -> Image {
        match self {
            Genuine(epoch, _, key) => Image {
                epoch,
                by_second: key == Second,
            },
            _ => Image {
                epoch: 1,
                by_second: false,
            },
        }
    }
}

/// Records that a start writes, at most: the check of one image and its first trial, and one to spare.
const MOST_WRITES: usize = 4;

/// A unit whose application runs, or which is without power.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Unit {
    slots: [Content; 2],
    record: Option<Record>,
    chosen: Option<Slot>,
    /// The slot that runs, and whether 0xB001 was ordered since it started. `None` without power.
    runs: Option<(Slot, bool)>,
    /// The first key was revoked once. No part knows this when the boot state is lost.
    ended: bool,
}

/// The part during a start. The flash refuses more than this number of writes.
struct Starting {
    slots: [Content; 2],
    record: Option<Record>,
    writes: usize,
}

impl Starting {
    fn content(&self, slot: Slot) -> Content {
        self.slots[slot as usize]
    }
}

impl Part for Starting {
    fn is_intact(&mut self, slot: Slot) -> bool {
        self.content(slot) != Nothing
    }

    fn image(&mut self, slot: Slot) -> Image {
        self.content(slot).image()
    }

    fn check(&mut self, slot: Slot, floor: u16, revoked: bool) -> Result<(), Reason> {
        match self.content(slot) {
            Genuine(_, _, First) if revoked => Err(Reason::Signature),
            Genuine(epoch, ..) if epoch >= floor => Ok(()),
            Genuine(..) => Err(Reason::Epoch),
            Forged => Err(Reason::Signature),
            Nothing => Err(Reason::Crc),
        }
    }

    fn write(&mut self, record: Record) -> Result<(), Unwritten> {
        self.writes = self.writes.checked_sub(1).ok_or(Unwritten)?;
        self.record = Some(record);
        Ok(())
    }
}

impl Unit {
    fn content(&self, slot: Slot) -> Content {
        self.slots[slot as usize]
    }

    fn state(&self, slot: Slot) -> Option<State> {
        self.record.map(|record| record.state(slot))
    }

    fn with_record(self, record: Option<Record>) -> Self {
        let revoked = record.is_some_and(|record| record.is_revoked());
        Self {
            record,
            ended: self.ended || revoked,
            ..self
        }
    }

    fn without_power(self) -> Self {
        Self {
            chosen: None,
            runs: None,
            ..self
        }
    }

    /// Returns the units that a reset may lead to: for each number of writes a unit whose power fails after them and a unit
    /// whose flash refuses the next write, and last the unit that has started.
    fn started(self, asked: bool, switched: bool) -> Vec<Self> {
        let mut after = vec![self.without_power()];
        for writes in 0..=MOST_WRITES {
            let mut part = Starting {
                slots: self.slots,
                record: self.record,
                writes,
            };
            let mut start = Start {
                asked,
                switched,
                chosen: self.chosen,
            };
            let mut next = decide(&mut part, self.record, start);
            if next == Next::Reset {
                // The loader's own reset keeps SW01 and is not an order.
                start.asked = false;
                let record = part.record;
                next = decide(&mut part, record, start);
            }
            let unit = self.with_record(part.record);
            if self.record.is_none()
                && let Some(record) = unit.record
            {
                let is_left = self.slots.iter().any(|slot| slot.image().by_second);
                assert!(
                    !self.ended || record.is_revoked() || !is_left,
                    "loses the revocation with the boot state: {self:?}"
                );
            }
            after.push(unit.without_power());
            after.extend(unit.runs(next));
            assert!(
                writes < MOST_WRITES || part.writes > 0,
                "{self:?} writes more"
            );
        }
        after
    }

    fn runs(self, next: Next) -> Option<Self> {
        match next {
            Next::Run { slot, chosen } => {
                assert!(
                    matches!(self.content(slot), Genuine(..)),
                    "{self:?} starts {slot:?}"
                );
                if let Some(record) = self.record {
                    let is_last_resort = slot != record.preferred
                        && record.state(slot) == State::Confirmed
                        && !chosen;
                    let is_preferred =
                        slot == record.preferred && record.state(slot) == State::Confirmed;
                    let image = self.content(slot).image();
                    let may = record.allows(image)
                        || is_last_resort
                        || is_preferred && image.epoch >= record.floor;
                    assert!(may, "{self:?} {slot:?}");
                }
                Some(Self {
                    chosen: chosen.then_some(slot),
                    runs: Some((slot, false)),
                    ..self
                })
            }
            Next::Reset => panic!("{self:?} does not start"),
            Next::Nothing => {
                assert_eq!(self.record, None, "{self:?} starts nothing");
                None
            }
        }
    }

    /// Returns the unit after the loader's normal end.
    fn restarted(self) -> Self {
        *self.started(false, false).last().unwrap()
    }

    /// Returns every unit that may follow.
    fn next(self) -> Vec<Self> {
        let off = self.without_power();
        let mut after = off.started(false, false);
        after.extend(off.started(false, true));
        let Some((slot, prepared)) = self.runs else {
            return after;
        };
        // The watchdog, a fault, the reset pin.
        after.extend(self.started(false, false));
        let Some(record) = self.record else {
            return after;
        };
        let running = Running {
            record,
            slot,
            prepared,
        };
        let other = slot.other();
        let with = |content| {
            let mut slots = self.slots;
            slots[other as usize] = content;
            Self { slots, ..self }
        };
        // Both pages of the boot state are lost.
        if self
            .slots
            .iter()
            .any(|slot| matches!(slot, Genuine(_, Serves, _)))
        {
            after.push(off.with_record(None));
        }
        // The flash of a slot ages, also that of the running image.
        if running.is_confirmed() {
            after.push(with(Nothing));
        }
        if record.state(other) == State::Confirmed && self.content(other) != Nothing {
            let mut slots = self.slots;
            slots[slot as usize] = Nothing;
            after.push(Self { slots, ..off });
        }
        let Genuine(_, Serves, _) = self.content(slot) else {
            return after;
        };
        let [own, there] = [slot, other].map(|slot| self.content(slot).image());
        // COMMAND 2.
        after.extend(self.started(true, false));
        // 0xB002, 0xB003 and 0xB004 end the choice of SW01 = 254.
        let ordered = |record| Self {
            chosen: None,
            ..self.with_record(Some(record))
        };
        if let Ok(record) = running.after(Order::Prepare, there) {
            // Before, during and after the erase.
            for unit in [self, with(Nothing)] {
                after.push(Self {
                    record: Some(record),
                    runs: Some((slot, true)),
                    ..unit
                });
            }
        }
        if running.other() == State::Receiving {
            after.extend(CONTENTS.map(with));
        }
        let intact = self.content(other) != Nothing;
        let finished = running.after(Order::Finish, there);
        if let Some(record) = finished.ok().filter(|_| intact) {
            after.extend(ordered(record).started(false, false));
        }
        if let Ok(record) = running.after(Order::Confirm, own) {
            after.push(ordered(record));
        }
        let back = running.after(Order::GoBack, there);
        if let Some(record) = back.ok().filter(|_| intact) {
            after.extend(ordered(record).started(false, false));
        }
        after
    }

    /// Checks what must always be so.
    fn check(self) {
        let Some(record) = self.record else {
            return;
        };
        let confirmed = |slot: &Slot| {
            record.state(*slot) == State::Confirmed && matches!(self.content(*slot), Genuine(..))
        };
        assert!(
            Slot::ALL.iter().any(confirmed),
            "no confirmed image: {self:?}"
        );
        let mut unit = self;
        for _ in 0..=TRIALS {
            match unit.runs {
                Some((slot, _)) if unit.state(slot) != Some(State::Confirmed) => {
                    unit = unit.restarted();
                }
                _ => return,
            }
        }
        let (slot, _) = unit.runs.unwrap();
        let state = unit.state(slot);
        assert_eq!(state, Some(State::Confirmed), "is never left: {self:?}");
    }
}

#[test]
fn nothing_unsigned_starts_no_confirmed_image_is_lost_and_no_state_is_a_dead_end() {
    let mut seen: HashSet<Unit> = HashSet::new();
    for a in CONTENTS {
        for b in CONTENTS {
            let slots = [a, b];
            if slots
                .iter()
                .any(|slot| matches!(slot, Genuine(_, Serves, _)))
            {
                seen.insert(Unit {
                    slots,
                    record: None,
                    chosen: None,
                    runs: None,
                    ended: false,
                });
            }
        }
    }
    let mut todo: Vec<Unit> = seen.iter().copied().collect();
    while let Some(unit) = todo.pop() {
        unit.check();
        todo.extend(unit.next().into_iter().filter(|next| seen.insert(*next)));
    }
    for slot in Slot::ALL {
        let is_end = |unit: &&Unit| {
            let states = unit.record.map(|record| record.states);
            unit.runs == Some((slot, false)) && states == Some([State::Confirmed; 2])
        };
        assert!(
            seen.iter().any(|unit| is_end(&unit)),
            "no update ends in {slot:?}"
        );
    }
    std::println!("{} states", seen.len());
    assert!(seen.len() > 1000, "only {} states", seen.len());
}
