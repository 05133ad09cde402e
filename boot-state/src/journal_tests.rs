//! Tests of the journal on a flash whose power fails at any operation.

extern crate std;
use std::{vec, vec::Vec};

use super::*;
use register_map::update::Reason;

const PAGE: usize = 1024;

/// Two pages. The power fails during operation number `cut`, which leaves what `left` says.
#[derive(Clone, Debug)]
struct Flash {
    pages: [Vec<u8>; 2],
    operations: usize,
    cut: Option<(usize, Left)>,
    /// The half-word whose programming was cut. It reads differently at every start.
    weak: Option<(Page, usize, [u16; 2])>,
}

/// What a cut leaves: nothing of the operation, all of it, or something that reads as one or the other.
#[derive(Clone, Copy, Debug)]
enum Left {
    Nothing,
    All,
    Weak,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Failure {
    Cut,
    NotErased,
}

impl Flash {
    fn new(byte: u8) -> Self {
        Self {
            pages: [vec![byte; PAGE], vec![byte; PAGE]],
            operations: 0,
            cut: None,
            weak: None,
        }
    }

    fn bytes(&mut self, page: Page) -> &mut Vec<u8> {
        &mut self.pages[page as usize]
    }

    /// Returns what the operation leaves if the power fails during it.
    fn left(&mut self) -> Option<Left> {
        self.operations += 1;
        self.cut
            .filter(|(at, _)| *at == self.operations)
            .map(|(_, left)| left)
    }

    fn set(&mut self, page: Page, offset: usize, half: u16) {
        self.bytes(page)[offset..offset + 2].copy_from_slice(&half.to_le_bytes());
    }

    fn half(&self, page: Page, offset: usize) -> u16 {
        let bytes = &self.pages[page as usize];
        u16::from_le_bytes([bytes[offset], bytes[offset + 1]])
    }

    /// Starts the part: a weak half-word reads as before its programming (0) or as after it (1).
    fn start(mut self, reading: usize) -> Self {
        self.cut = None;
        if let Some((page, offset, values)) = self.weak {
            self.set(page, offset, values[reading]);
        }
        self
    }
}

impl Pages for Flash {
    type Error = Failure;

    fn page(&self, page: Page) -> &[u8] {
        &self.pages[page as usize]
    }

    fn program(&mut self, page: Page, offset: usize, half: u16) -> Result<(), Failure> {
        let old = self.half(page, offset);
        let new = if half == 0 || old == 0xFFFF {
            half
        } else {
            return Err(Failure::NotErased);
        };
        let is_weak = self
            .weak
            .is_some_and(|(at, weak, _)| (at, weak) == (page, offset));
        if is_weak {
            self.weak = None;
        }
        match self.left() {
            None => self.set(page, offset, new),
            Some(Left::Nothing) => return Err(Failure::Cut),
            Some(Left::All) => {
                self.set(page, offset, new);
                return Err(Failure::Cut);
            }
            Some(Left::Weak) => {
                self.weak = Some((page, offset, [old, new]));
                return Err(Failure::Cut);
            }
        }
        Ok(())
    }

    fn erase(&mut self, page: Page) -> Result<(), Failure> {
        if self.weak.is_some_and(|(at, ..)| at == page) {
            self.weak = None;
        }
        match self.left() {
            None => self.bytes(page).fill(0xFF),
            Some(Left::Nothing) => return Err(Failure::Cut),
            Some(Left::All) => {
                self.bytes(page).fill(0xFF);
                return Err(Failure::Cut);
            }
            Some(Left::Weak) => {
                // Every second half-word is erased.
                for (n, byte) in self.bytes(page).iter_mut().enumerate() {
                    if n & 2 == 0 {
                        *byte = 0xFF;
                    }
                }
                return Err(Failure::Cut);
            }
        }
        Ok(())
    }
}

fn state(n: u16) -> Record {
    Record {
        preferred: if n.is_multiple_of(2) {
            Slot::A
        } else {
            Slot::B
        },
        states: [State::Rejected(Reason::Hash), State::Trial(2)],
        floor: n,
        bits: (n as u8) << 1,
    }
}

/// Opens the journal as a start does.
fn open(flash: &mut Flash) -> Journal {
    let mut journal = Journal::open(flash);
    assert_eq!(journal.settle(flash), Ok(()));
    assert!(journal.is_settled());
    journal
}

/// Writes states 1 to `count`.
fn written(mut flash: Flash, count: u16) -> Flash {
    let mut journal = open(&mut flash);
    for n in 1..=count {
        journal.write(&mut flash, state(n)).unwrap();
        assert_eq!(Journal::open(&flash).record(), Some(state(n)));
    }
    flash
}

#[test]
fn newest_record_counts_through_many_changes_of_pages() {
    for byte in [0xFF, 0x00, 0xA5] {
        assert_eq!(Journal::open(&Flash::new(byte)).record(), None);
        let flash = written(Flash::new(byte), 1000);
        // A record is ten operations; 51 fit a page.
        assert_eq!(
            flash.operations,
            1000 * (BYTES / 2) + 1000_usize.div_ceil(PAGE / BYTES)
        );
    }
}

#[test]
fn cut_at_any_operation_leaves_the_state_before_or_after_and_room_for_the_next() {
    let in_page = (PAGE / BYTES) as u16;
    for count in [1, 2, in_page - 1, in_page, 2 * in_page] {
        let before = written(Flash::new(0xFF), count);
        for at in 1..=BYTES / 2 + 1 {
            for left in [Left::Nothing, Left::All, Left::Weak] {
                let mut cut = before.clone();
                let mut journal = open(&mut cut);
                cut.cut = Some((cut.operations + at, left));
                let _ = journal.write(&mut cut, state(1000));
                for readings in [[0, 0], [0, 1], [1, 0], [1, 1]] {
                    let mut flash = cut.clone().start(readings[0]);
                    let mut journal = open(&mut flash);
                    let known = journal.record();
                    assert!(
                        [Some(state(count)), Some(state(1000))].contains(&known),
                        "{count} {at} {left:?}: {known:?}"
                    );
                    // A later start reads the same, whatever the weak cells read then.
                    let mut later = flash.clone().start(readings[1]);
                    assert_eq!(open(&mut later).record(), known, "{count} {at} {left:?}");
                    journal.write(&mut flash, state(2000)).unwrap();
                    let mut flash = flash.start(readings[1]);
                    let mut journal = open(&mut flash);
                    assert_eq!(journal.record(), Some(state(2000)), "{count} {at} {left:?}");
                    journal.write(&mut flash, state(3000)).unwrap();
                    assert_eq!(open(&mut flash).record(), Some(state(3000)));
                }
            }
        }
    }
}

#[test]
fn any_wrong_bit_of_a_record_makes_the_one_before_count() {
    let right = written(Flash::new(0xFF), 2);
    for bit in 0..8 * SEALS {
        let mut flash = right.clone();
        flash.pages[0][BYTES + bit / 8] ^= 1 << (bit % 8);
        assert_eq!(open(&mut flash).record(), Some(state(1)), "bit {bit}");
    }
}

/// Once a loader is released, these bytes never change: its code stays. Those of records 1 to 3 were written by
/// the code of commit 59e66739, which knows no revocation.
#[test]
fn bytes_of_a_record_are_those_of_every_loader() {
    let record = |preferred, states, floor, bits| Record {
        preferred,
        states,
        floor,
        bits,
    };
    let [empty, confirmed] = [State::Empty, State::Confirmed];
    let signature = State::Rejected(Reason::Signature);
    let written = [
        (
            record(Slot::A, [confirmed, empty], 7, 0),
            [0x01, 0, 0, 0, 0x00, 0x05, 0, 0, 0x07, 0, 0x01, 0x42],
            [0xD1, 0x82, 0x82, 0xFE],
        ),
        (
            record(Slot::B, [signature, confirmed], 0x1234, 0),
            [0x02, 0, 0, 0, 0x01, 0x56, 8, 0, 0x34, 0x12, 0x01, 0x42],
            [0xFF, 0xFD, 0x18, 0xF4],
        ),
        (
            record(Slot::A, [confirmed, State::Trial(2)], 1, 0),
            [0x03, 0, 0, 0, 0x00, 0x45, 0, 2, 0x01, 0, 0x01, 0x42],
            [0x3E, 0x2C, 0x02, 0x63],
        ),
        (
            record(
                Slot::B,
                [State::New, confirmed],
                2,
                Record::FIRST_KEY_REVOKED,
            ),
            [0x04, 0, 0, 0, 0x03, 0x52, 0, 0, 0x02, 0, 0x01, 0x42],
            [0xE7, 0x9F, 0x0D, 0x22],
        ),
        (
            // The highest bit of byte 4 is of a newer image.
            record(Slot::A, [State::Checking, State::Receiving], 2, 0x82),
            [0x05, 0, 0, 0, 0x82, 0x13, 0, 0, 0x02, 0, 0x01, 0x42],
            [0x7A, 0x4A, 0x39, 0x5F],
        ),
    ];
    let mut flash = Flash::new(0xFF);
    let mut journal = open(&mut flash);
    for (n, (record, covered, crc)) in written.into_iter().enumerate() {
        journal.write(&mut flash, record).unwrap();
        let bytes = [&covered[..], &crc, &[0; 4]].concat();
        let at = n * BYTES;
        assert_eq!(flash.pages[0][at..at + BYTES], bytes, "record {n}");
        assert_eq!(open(&mut flash.clone()).record(), Some(record));
    }
}
