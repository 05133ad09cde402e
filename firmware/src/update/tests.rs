//! The update of a unit that runs from slot A, with a mock slot B.

extern crate std;

use std::vec;
use std::vec::Vec;

use ports::pages::Slot as InFlash;
use register_map::board::MODIO_02;
use register_map::update::{crc32, place_of};

use super::*;

const LAYOUT: Layout = MODIO_02.layout();
const PAGE: usize = 1024;

/// A slot of flash.
struct Flash {
    bytes: Vec<u8>,
    erases: usize,
    /// A half-word whose bits cannot be cleared.
    worn: Option<usize>,
    /// The supply is too low.
    low: bool,
}

/// The controller refuses because of the supply, or because a half-word is not erased.
#[derive(Debug, PartialEq, Eq)]
enum Refused {
    Low,
    NotErased,
}

impl InFlash for Flash {
    type Error = Refused;

    fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn page_bytes(&self) -> usize {
        PAGE
    }

    fn program(&mut self, offset: usize, half: u16) -> Result<(), Refused> {
        if self.low {
            return Err(Refused::Low);
        }
        let place = &mut self.bytes[offset..offset + 2];
        if place != [0xFF; 2] && half != 0 {
            return Err(Refused::NotErased);
        }
        if self.worn != Some(offset) {
            place.copy_from_slice(&half.to_le_bytes());
        }
        Ok(())
    }

    fn erase(&mut self, page: usize) -> Result<(), Refused> {
        if self.low {
            return Err(Refused::Low);
        }
        self.bytes[page * PAGE..][..PAGE].fill(0xFF);
        self.erases += 1;
        Ok(())
    }
}

/// The numbers of the loader's keys. The first signed the running image.
const KEYS: [u16; 4] = [0x1111, 0x2222, 0x3333, 0x4444];

/// A unit, and the boot states that were written.
struct Unit {
    update: Update,
    flash: Flash,
    written: Vec<Record>,
    refuses: bool,
    carried_out: Option<Order>,
}

impl Unit {
    /// Returns a unit whose slot B has this state, and zeros.
    fn new(other: State) -> Self {
        let record = Record {
            preferred: Slot::A,
            states: [State::Confirmed, other],
            floor: 3,
            bits: 0,
        };
        let running = [0x0002, 0, 4, 0, 0, 300, 0x1111, 0x2222, 0xAAAA, 0xBBBB];
        let images = [running, [0; 10]];
        Self {
            update: Update::new(1, &LAYOUT, Slot::A, Some(record), images, KEYS, false),
            flash: Flash {
                bytes: vec![0; LAYOUT.slot as usize],
                erases: 0,
                worn: None,
                low: false,
            },
            written: Vec::new(),
            refuses: false,
            carried_out: None,
        }
    }

    /// Returns a unit that takes blocks over the RS-485 line.
    fn prepared() -> Self {
        let mut unit = Self::new(State::Empty);
        unit.order(Order::Prepare);
        assert_eq!(unit.flash.erases, 54);
        unit
    }

    /// Performs a step. Returns whether there was one.
    fn step(&mut self) -> bool {
        let Some(job) = self.update.next() else {
            return false;
        };
        let done = match &job {
            Job::Write(_) if self.refuses => Err(Failed(None)),
            Job::Write(record) => {
                self.written.push(*record);
                Ok(())
            }
            Job::InSlot(step) => match step.perform(&mut self.flash, crc32) {
                Ok(done) => done,
                Err(Refused::Low) => return false,
                Err(Refused::NotErased) => Err(Failed(None)),
            },
        };
        let image = described(&self.flash.bytes);
        self.carried_out = self.update.end(&job, done, image);
        true
    }

    fn work(&mut self) {
        while self.step() {}
    }

    fn order(&mut self, order: Order) {
        assert!(self.update.check(order, 1).is_ok());
        self.update.take(order, LineName::Rs485);
        self.work();
    }

    /// Sends a block, and does not wait until it is programmed.
    fn send(&mut self, number: u16, bytes: &[u8]) -> Result<(), Exception> {
        let (file, record) = place_of(Slot::B, number);
        let records = Span::new(record, BLOCK).unwrap();
        let words = Words::new(bytes);
        let checked = self
            .update
            .check_write(file, records, words, LineName::Rs485);
        if checked.is_ok() {
            self.update.write(file, records, words);
        }
        checked
    }

    /// Sends an image, each block twice, from the header on and then the last blocks first.
    fn send_all(&mut self, image: &[u8]) {
        let blocks: Vec<_> = (0..).zip(image.chunks(BLOCK_BYTES)).collect();
        let (header, rest) = blocks.split_first().unwrap();
        for (number, block) in std::iter::once(header).chain(rest.iter().rev()) {
            for _ in 0..2 {
                assert_eq!(self.send(*number, block), Ok(()), "{number}");
                self.work();
            }
        }
    }

    fn state(&self) -> [u16; 4] {
        [0, 1, 2, 3].map(|record| self.update.record(record))
    }
}

/// Returns an image of `blocks` blocks for a slot, filled with this byte.
fn image_for(slot: Slot, board: u8, blocks: u16, fill: u8) -> Vec<u8> {
    let mut image = vec![0; 512];
    image[..4].copy_from_slice(b"MODI");
    image[4..6].copy_from_slice(&[2, board]);
    image[6] = 3;
    image[12..16].copy_from_slice(&LAYOUT.slots[slot as usize].to_le_bytes());
    image.resize(usize::from(blocks) * BLOCK_BYTES, fill);
    let length = image.len() as u32 - 512;
    image[16..20].copy_from_slice(&length.to_le_bytes());
    let crc = crc32([&image[..20], &image[512..]]);
    image[20..24].copy_from_slice(&crc.to_le_bytes());
    image
}

fn image(fill: u8) -> Vec<u8> {
    image_for(Slot::B, 1, 20, fill)
}

const BUSY: Result<(), Exception> = Err(Exception::ServerDeviceBusy);

#[test]
fn whole_image_becomes_new_and_the_device_restarts() {
    let mut unit = Unit::prepared();
    assert_eq!(unit.state(), [1, 0, 0, 0]);
    let image = image(0xA5);
    assert_eq!(unit.send(1, &image[128..256]), BUSY, "the header is first");
    assert_eq!(unit.send(0, &image[..128]), Ok(()));
    assert_eq!(unit.state(), [1, 0, 20, 20]);
    unit.send_all(&image);
    assert_eq!(unit.state(), [1, 0, 20, 0]);
    assert_eq!(unit.flash.bytes[..image.len()], image);
    assert_eq!(unit.flash.erases, 54, "no page was bad");
    assert_eq!(unit.update.record(16 + 5), 20, "blocks of the other image");
    unit.order(Order::Finish);
    assert_eq!(unit.carried_out, Some(Order::Finish));
    assert_eq!(unit.send(1, &image[128..256]), BUSY, "it is checked");
    let states: Vec<_> = unit.written.iter().map(|record| record.states[1]).collect();
    assert_eq!(states, [State::Receiving, State::New]);
}

#[test]
fn pages_are_erased_one_after_another_and_blocks_wait_for_all() {
    let mut unit = Unit::new(State::Confirmed);
    let image = image(1);
    assert_eq!(unit.send(0, &image[..128]), BUSY, "not prepared");
    unit.update.take(Order::Prepare, LineName::Rs485);
    for pages in (0..=54).rev() {
        assert_eq!(unit.update.record(status::PAGES), pages.min(54));
        assert_eq!(
            unit.send(0, &image[..128]),
            if pages == 0 { Ok(()) } else { BUSY }
        );
        assert!(unit.step());
        if pages == 54 {
            assert_eq!(unit.update.record(status::PAGES), 54, "the state is first");
            assert!(unit.step());
        }
    }
}

#[test]
fn blocks_of_another_line_slot_board_or_place_are_refused() {
    let mut unit = Unit::prepared();
    let good = image(1);
    let words = Words::new(&good[..128]);
    let at = |file, record, count| (file, Span::new(record, count).unwrap());
    for ((file, records), line, exception) in [
        (
            at(0x180, 0, 64),
            LineName::Second,
            Exception::ServerDeviceBusy,
        ),
        (
            at(0x100, 0, 64),
            LineName::Rs485,
            Exception::IllegalDataAddress,
        ),
        (
            at(0x180, 1, 64),
            LineName::Rs485,
            Exception::IllegalDataAddress,
        ),
        (
            at(0x183, 3072, 64),
            LineName::Rs485,
            Exception::IllegalDataAddress,
        ),
        (at(2, 0, 64), LineName::Rs485, Exception::IllegalDataAddress),
        (
            at(0x180, 0, 63),
            LineName::Rs485,
            Exception::IllegalDataValue,
        ),
    ] {
        let checked = unit.update.check_write(file, records, words, line);
        assert_eq!(checked, Err(exception), "{file:#x} {records:?}");
    }
    for (reason, wrong) in [
        (2, image_for(Slot::B, 2, 20, 1)),
        (3, image_for(Slot::A, 1, 20, 1)),
        (4, image_for(Slot::B, 1, 433, 1)),
        (1, vec![0x55; 128]),
    ] {
        assert_eq!(
            unit.send(0, &wrong[..128]),
            Err(Exception::IllegalDataValue)
        );
        assert_eq!(unit.state(), [1, reason, 0, 0]);
    }
    assert_eq!(unit.send(0, &good[..128]), Ok(()));
    assert_eq!(unit.state(), [1, 0, 20, 20]);
    assert_eq!(unit.send(1, &good[128..256]), Ok(()));
    unit.work();
    // Blocks behind the header of another image are not this unit's.
    let other = image_for(Slot::B, 2, 20, 9);
    assert!(unit.send(0, &other[..128]).is_err());
    assert_eq!(unit.send(2, &other[256..384]), BUSY);
    assert_eq!(unit.send(0, &good[..128]), Ok(()));
    assert_eq!(unit.state(), [1, 0, 20, 18]);
    assert_eq!(
        unit.send(20, &good[..128]),
        Err(Exception::IllegalDataAddress)
    );
}

#[test]
fn two_blocks_are_staged_and_a_third_is_refused() {
    let mut unit = Unit::prepared();
    let image = image(7);
    let block = |n: usize| &image[n * 128..][..128];
    assert_eq!(unit.send(0, block(0)), Ok(()));
    assert_eq!(unit.send(5, block(5)), Ok(()));
    assert_eq!(unit.send(6, block(6)), BUSY);
    assert!(unit.step());
    assert_eq!(unit.send(6, block(6)), Ok(()));
    unit.flash.low = true;
    unit.work();
    assert_eq!(unit.state()[3], 19, "the supply is low");
    unit.flash.low = false;
    unit.work();
    assert_eq!(unit.state()[3], 17);
    assert_eq!(unit.update.record(status::BITMAP), 0xFF9E);
}

#[test]
fn another_image_over_the_first_one_erases_what_differs() {
    let mut unit = Unit::prepared();
    unit.send_all(&image(0xA5));
    let other = image(0x5A);
    let mut rounds = 0;
    while unit.state()[..] != [1, 0, 20, 0] || unit.flash.bytes[..other.len()] != other {
        for (number, block) in (0..).zip(other.chunks(128)) {
            let _ = unit.send(number, block);
            unit.work();
        }
        rounds += 1;
        assert!(rounds < 5, "{:?}", unit.state());
    }
    assert_eq!(unit.flash.erases - 54, 3, "pages of 8 blocks");
    unit.order(Order::Finish);
    assert_eq!(unit.carried_out, Some(Order::Finish));
}

#[test]
fn page_that_does_not_take_its_block_is_erased_eight_times_at_most() {
    let mut unit = Unit::prepared();
    unit.flash.worn = Some(9 * 128);
    let image = image(7);
    assert_eq!(unit.send(0, &image[..128]), Ok(()));
    unit.work();
    for attempt in 0..9 {
        assert_eq!(unit.send(9, &image[9 * 128..][..128]), Ok(()), "{attempt}");
        unit.work();
    }
    assert_eq!(unit.flash.erases, 54 + 8);
    assert_eq!(unit.send(9, &image[9 * 128..][..128]), BUSY);
    assert_eq!(unit.send(0, &image[..128]), BUSY);
    unit.flash.worn = None;
    unit.order(Order::Prepare);
    unit.send_all(&image);
    assert_eq!(unit.state()[3], 0);
}

#[test]
fn wrong_crc_leaves_the_state_and_every_block_counts_as_missing() {
    let mut unit = Unit::prepared();
    let mut wrong = image(7);
    wrong[600] ^= 2;
    unit.send_all(&wrong);
    unit.order(Order::Finish);
    assert_eq!((unit.state(), unit.carried_out), ([1, 6, 20, 20], None));
    assert_eq!(unit.written.len(), 1);
    // The missing bit can only be erased.
    unit.send_all(&wrong);
    unit.flash.bytes[600] ^= 2;
    unit.order(Order::Finish);
    assert_eq!(unit.carried_out, Some(Order::Finish));
}

#[test]
fn orders_need_a_confirmed_image_and_a_genuine_one_to_go_back_to() {
    let unit = Unit::new(State::Empty);
    let check = |unit: &Unit| {
        [Order::Prepare, Order::Finish, Order::Confirm, Order::GoBack]
            .map(|order| unit.update.check(order, 1).is_ok())
    };
    assert_eq!(check(&unit), [true, false, true, false]);
    // Rejected because the check was interrupted: it may be checked again.
    let mut unit = Unit::new(State::Rejected(Reason::Interrupted));
    unit.flash.bytes = image(5);
    assert_eq!(check(&unit), [true, true, true, false]);
    unit.order(Order::Finish);
    assert_eq!(unit.carried_out, Some(Order::Finish));
    // Confirmed, but below the floor, and then not.
    let mut unit = Unit::new(State::Confirmed);
    assert_eq!(check(&unit), [true, false, true, false]);
    unit.update.images[1][2] = 3;
    assert_eq!(check(&unit), [true, false, true, true]);
    unit.order(Order::GoBack);
    assert_eq!(unit.state()[1], 1, "no image is there");
    assert_eq!(unit.written, []);
    unit.flash.bytes = image(5);
    unit.update.images[1] = described(&unit.flash.bytes);
    unit.order(Order::GoBack);
    assert_eq!(unit.written[0].states[1], State::Trial(0));
    // On trial only the confirmation is possible.
    unit.update.running.record.states[0] = State::Trial(1);
    assert!(unit.update.is_on_trial());
    assert_eq!(check(&unit), [false, false, true, false]);
    unit.order(Order::Confirm);
    assert_eq!(
        (unit.carried_out, unit.update.is_on_trial()),
        (Some(Order::Confirm), false)
    );
    assert_eq!(
        unit.update.record(status::FLOOR),
        4,
        "the epoch of the image"
    );
}

#[test]
fn image_by_the_second_key_ends_the_first_when_it_is_confirmed() {
    let by = |unit: &mut Unit, image: usize, key: [u16; 2]| {
        // Of the epoch of the floor.
        unit.update.images[image][2] = 4;
        unit.update.images[image][6..8].copy_from_slice(&key);
    };
    let [first, second] = [[0x1111, 0x2222], [0x3333, 0x4444]];
    let mut unit = Unit::new(State::Confirmed);
    by(&mut unit, 1, first);
    by(&mut unit, 0, second);
    assert!(unit.update.check(Order::GoBack, 1).is_ok());
    unit.order(Order::Confirm);
    assert_eq!(unit.update.record(status::REVOKED), 1);
    assert!(
        unit.update.check(Order::GoBack, 1).is_err(),
        "the first key"
    );
    assert!(unit.update.check(Order::Prepare, 1).is_ok());
    by(&mut unit, 1, second);
    assert!(unit.update.check(Order::GoBack, 1).is_ok());
    // A last resort by the first key is left by an update, and never confirmed.
    by(&mut unit, 0, first);
    assert!(unit.update.check(Order::Confirm, 1).is_err());
    // A loader that does not say its keys: nothing is by the second.
    let mut unit = Unit::new(State::Confirmed);
    unit.update.keys = [0; 4];
    by(&mut unit, 0, [0; 2]);
    unit.order(Order::Confirm);
    assert_eq!(unit.update.record(status::REVOKED), 0);
}

#[test]
fn orders_that_begin_a_loop_cost_a_save() {
    let costs = |state, order| {
        let mut unit = Unit::new(state);
        unit.update.images[1][2] = 4;
        let left = [0, 1].map(|saves| unit.update.check(order, saves));
        assert_eq!(left[0].is_ok(), left[1] == Ok(false), "{state:?} {order:?}");
        left[1]
    };
    assert_eq!(costs(State::Empty, Order::Prepare), Ok(true));
    assert_eq!(costs(State::Confirmed, Order::GoBack), Ok(true));
    let again = State::Rejected(Reason::NotConfirmed);
    assert_eq!(costs(again, Order::Finish), Ok(true));
    assert_eq!(costs(State::Empty, Order::Confirm), Ok(false));
    let mut unit = Unit::prepared();
    unit.send_all(&image(7));
    assert_eq!(unit.update.check(Order::Finish, 0), Ok(false));
}

/// The loader mends a lost boot state at the next start.
#[test]
fn unit_without_a_boot_state_takes_no_order() {
    let images = [[1; 10]; 2];
    let unit = Update::new(1, &LAYOUT, Slot::B, None, images, KEYS, false);
    for order in [Order::Prepare, Order::Finish, Order::Confirm, Order::GoBack] {
        assert!(unit.check(order, 1).is_err(), "{order:?}");
    }
    assert!(!unit.is_on_trial(), "it runs on");
    assert_eq!(unit.record(status::SLOT), 2);
}

#[test]
fn state_that_cannot_be_written_changes_nothing() {
    let mut unit = Unit::new(State::Confirmed);
    unit.refuses = true;
    unit.order(Order::Prepare);
    assert_eq!((unit.flash.erases, unit.state()[0]), (0, 5));
    let image = image(7);
    assert_eq!(unit.send(0, &image[..128]), BUSY);
    unit.refuses = false;
    unit.order(Order::Prepare);
    assert_eq!(unit.state()[0], 1);
}

#[test]
fn register_and_file_2_report_the_unit() {
    let mut unit = Unit::new(State::Rejected(Reason::Signature));
    assert_eq!(unit.state(), [6, 8, 0, 0]);
    assert_eq!(
        [4, 5, 6, 7].map(|record| unit.update.record(record)),
        [1, 3, 0, 0]
    );
    assert_eq!(unit.update.register(), 1 | 6 << 2);
    unit.update.switched = true;
    unit.update.running.record.states[0] = State::Trial(2);
    assert_eq!(unit.update.register(), 1 | 6 << 2 | 1 << 5 | 1 << 6);
    let running = (8..16).map(|record| unit.update.record(record));
    assert!(running.eq([2, 0, 4, 0, 0, 300, 0x1111, 0x2222]));
    unit.update.images[1] = core::array::from_fn(|n| n as u16 + 1);
    let other = (16..24).map(|record| unit.update.record(record));
    assert!(other.eq(1..=8));
    let behind = (24..34).map(|record| unit.update.record(record));
    assert!(behind.eq([0xAAAA, 0xBBBB, 9, 10, 0x1111, 0x2222, 0x3333, 0x4444, 0, 0]));
    let fits = |first, count| {
        unit.update
            .check_read(Span::new(first, count).unwrap())
            .is_ok()
    };
    assert!(
        fits(0, 91) && !fits(0, 92) && !fits(91, 1),
        "54 KiB are 432 blocks"
    );
}
