//! An update over the line: blocks into the slot that does not run, the orders, and what follows them.
//!
//! `refused` has images that must not start, and attacks; `keys` the end of the first key; `trial` what happens until an
//! image is confirmed, and the ways back; `service` the points during an update; `cuts` the power cuts.

mod cuts;
mod keys;
mod refused;
mod service;
mod trial;

use std::sync::LazyLock;

use register_map::codes::{Baud, Command};
use register_map::configuration::{BAUD, COMM_TIMEOUT, COMMAND, KEY, OPENING_KEY};
use register_map::state::{STACK_FREE, UPDATE};
use register_map::update::{BLOCK_BYTES, Slot, place_of, status};
use sim::line::{Format, Settings};
use sim::{Module, Time};

use crate::LAYOUT;
use crate::in_slots::{
    APPLICATION, CHECK, CRC, FIRST_KEY, HASH, SECOND_KEY, SIGNATURE, START, answers, answers_as,
    fitted, flash, holding, image, number, runs_from, sign, signed, signed_by, unit, with_crc,
};
use crate::rig::{PAGE_SIZE, Rig, SLOT, adu};
use crate::saving::SLOWEST;

/// The state of an update, from file 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Status {
    state: u16,
    reason: u16,
    blocks: u16,
    missing: u16,
    slot: u16,
    pages: u16,
}

/// The longest erase of a page (DS5319 table 28).
const ERASE: Time = Time::from_ms(40);

const CONFIRMED: u16 = 5;
const REJECTED: u16 = 6;

impl Rig {
    fn word(&mut self, address: u16, value: u16) -> Option<Vec<u8>> {
        let [[a, b], [c, d]] = [address, value].map(u16::to_be_bytes);
        self.ask(1, &[6, a, b, c, d])
    }

    /// Gives an order. Returns the exception.
    fn order(&mut self, command: Command) -> Result<(), u8> {
        self.word(KEY, OPENING_KEY).expect("it answers");
        match &self.word(COMMAND, command.code()).expect("it answers")[..] {
            [6, ..] => Ok(()),
            [_, exception] => Err(*exception),
            other => panic!("{other:?}"),
        }
    }

    fn records(&mut self, first: u16, count: u16) -> Vec<u16> {
        let [[r1, r0], [c1, c0]] = [first, count].map(u16::to_be_bytes);
        let reply = self.ask(1, &[0x14, 7, 6, 0, 2, r1, r0, c1, c0]);
        let reply = reply.expect("it answers");
        assert_eq!(reply[0], 0x14, "{reply:?}");
        let words = reply[4..].chunks(2);
        words
            .map(|word| u16::from_be_bytes([word[0], word[1]]))
            .collect()
    }

    fn update_status(&mut self) -> Status {
        let words = self.records(0, 7);
        let word = |record: u16| words[usize::from(record)];
        Status {
            state: word(status::STATE),
            reason: word(status::REASON),
            blocks: word(status::BLOCKS),
            missing: word(status::MISSING),
            slot: word(status::SLOT),
            pages: word(status::PAGES),
        }
    }

    /// Orders the preparation and waits for its end.
    fn prepare(&mut self) {
        assert_eq!(self.order(Command::Prepare), Ok(()));
        while self.update_status().pages > 0 {
            self.board.run_for(Time::from_ms(200));
        }
        assert_eq!(self.update_status().state, 1);
    }

    /// Sends a block. Returns the exception.
    fn block(&mut self, slot: Slot, number: u16, bytes: &[u8]) -> Result<(), u8> {
        let (file, record) = place_of(slot, number);
        let [[f1, f0], [r1, r0]] = [file, record].map(u16::to_be_bytes);
        let mut block = bytes.to_vec();
        block.resize(BLOCK_BYTES, 0xFF);
        let head = [0x15, 7 + BLOCK_BYTES as u8, 6, f1, f0, r1, r0, 0, 64];
        let request = [&head[..], &block].concat();
        let reply = self.ask(1, &request).expect("it answers");
        match reply[..] {
            [0x95, exception] => Err(exception),
            _ => {
                assert_eq!(reply, request);
                Ok(())
            }
        }
    }

    /// Sends an image to a slot, each block until it is taken.
    fn send(&mut self, slot: Slot, image: &[u8]) {
        for (number, block) in (0..).zip(image.chunks(BLOCK_BYTES)) {
            while let Err(exception) = self.block(slot, number, block) {
                assert_eq!(exception, 6);
                self.board.run_for(Time::from_ms(2));
            }
        }
    }

    /// Updates the unit with an image for slot B, up to the restart.
    fn update(&mut self, image: &[u8]) {
        self.prepare();
        self.send(Slot::B, image);
        self.board.run_for(Time::from_ms(50));
        assert_eq!(self.update_status().missing, 0);
        assert_eq!(self.order(Command::Finish), Ok(()));
    }
}

/// The line of these tests.
const FAST: Settings = Settings {
    baud: 921_600,
    format: Format::N2,
};

/// Returns a unit with these images, at 921600 bit/s.
fn unit_of(slots: [&[u8]; 2]) -> Rig {
    let mut rig = unit(slots, &[(BAUD, Baud::B921600.code())]);
    rig.settings(FAST);
    answers(&mut rig, CHECK + START).expect("it starts");
    // A reply waits for the erase of a page.
    rig.patience = ERASE;
    rig
}

/// Returns a unit that runs from slot A, and has nothing in slot B.
fn running() -> Rig {
    unit_of([&image(0), &[]])
}

/// Runs until the unit answers after an update, and returns how it then stands.
fn after(rig: &mut Rig) -> (usize, Status) {
    // The order is carried out after its reply.
    rig.board.run_for(Time::from_ms(20));
    answers(rig, CHECK + START).expect("it starts");
    (runs_from(rig), rig.update_status())
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_new_image_starts_and_serves_and_stays_once_it_is_confirmed() {
    let mut rig = running();
    assert_eq!(rig.update_status().slot, 1);
    rig.prepare();
    rig.send(Slot::B, &image(1));
    rig.board.run_for(ERASE);
    let free = rig.register(STACK_FREE);
    assert!(free >= 1024, "{free} bytes of stack");
    assert_eq!(rig.order(Command::Finish), Ok(()));
    let from = rig.board.now();
    let (slot, _) = after(&mut rig);
    println!("out of service for {:?}", rig.board.now() - from);
    assert_eq!(slot, 1);
    assert_eq!(rig.register(UPDATE) & 0b10_0011, 0b10_0010, "on trial");
    assert_eq!(rig.order(Command::Prepare), Err(6));
    assert_eq!(rig.order(Command::GoBack), Err(6));
    assert_eq!(rig.order(Command::Confirm), Ok(()));
    rig.board.run_for(ERASE);
    assert_eq!(rig.register(UPDATE), 0b1_0110, "confirmed, as the other");
    rig.board.cycle();
    assert_eq!(after(&mut rig).0, 1);
    // The way back takes the same trial.
    assert_eq!(rig.order(Command::GoBack), Ok(()));
    assert_eq!(after(&mut rig).0, 0);
    assert_eq!(rig.register(UPDATE) & 0b10_0011, 0b10_0001, "on trial");
    assert_eq!(rig.order(Command::Confirm), Ok(()));
    rig.board.run_for(ERASE);
    assert_eq!(rig.register(UPDATE), 0b1_0101);
}

/// The flash of a unit that has taken the image for slot B, and whose loader has not checked it yet.
static NEW: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut rig = running();
    rig.update(&image(1));
    while rig.board.pc() >= LAYOUT.board.layout().slots[0] {
        rig.board.run_for(Time::from_us(20));
    }
    rig.board.flash().to_vec()
});

/// The flash of a unit that runs from slot B since an update, with a confirmed image in slot A.
static UPDATED: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut rig = starting(NEW.clone());
    assert_eq!(after(&mut rig).0, 1);
    assert_eq!(rig.order(Command::Confirm), Ok(()));
    rig.board.run_for(ERASE);
    rig.board.flash().to_vec()
});

/// Returns a unit that is powered now, with this flash.
fn starting(flash: Vec<u8>) -> Rig {
    let mut rig = holding(flash, 1);
    rig.settings(FAST);
    rig.patience = ERASE;
    rig
}

/// Returns the unit of [`NEW`] with bytes changed in the image.
fn with_changes(changes: &[u8]) -> Rig {
    let mut flash = NEW.clone();
    let b = (LAYOUT.board.layout().slots[1] - 0x0800_0000) as usize;
    flash[b..b + changes.len()].copy_from_slice(changes);
    starting(flash)
}

/// The unit has been updated once, so both slots hold a confirmed image, and B runs.
fn updated(rig: &mut Rig, image: &[u8]) {
    rig.update(image);
    assert_eq!(after(rig).0, 1);
    assert_eq!(rig.order(Command::Confirm), Ok(()));
    rig.board.run_for(ERASE);
}
