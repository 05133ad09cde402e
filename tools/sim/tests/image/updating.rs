//! An update over the line: blocks into the slot that does not run, the orders, and what follows them.

use register_map::codes::Command;
use register_map::configuration::{COMMAND, KEY, OPENING_KEY};
use register_map::update::{BLOCK_BYTES, Slot, place_of, status};
use sim::Time;

use crate::bench::Bench;
use crate::slots::{CHECK, START, answers, image, runs_from, unit};

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

impl Bench {
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
        while self.update_status().pages > 0 {}
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

/// Returns a unit that runs from slot A.
fn running() -> Bench {
    let mut bench = unit([&image(0), &[]], &[]);
    answers(&mut bench, CHECK + START).expect("it starts");
    // A reply waits for the erase of a page.
    bench.patience = ERASE;
    bench
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_new_image_starts_and_serves_and_stays_once_it_is_confirmed() {
    let mut bench = running();
    assert_eq!(bench.update_status().slot, 1);
    let from = bench.board.now();
    bench.update(&image(1));
    println!("to the order: {:?}", bench.board.now() - from);
    let from = bench.board.now();
    answers(&mut bench, CHECK + START).expect("it starts");
    println!("to the answer: {:?}", bench.board.now() - from);
    assert_eq!(runs_from(&mut bench), 1);
    assert_eq!(bench.register(0x022A) & 0b10_0011, 0b10_0010, "on trial");
    assert_eq!(bench.order(Command::Prepare), Err(6));
    assert_eq!(bench.order(Command::Confirm), Ok(()));
    bench.board.run_for(Time::from_ms(100));
    assert_eq!(bench.register(0x022A), 0b1_0110, "confirmed, as the other");
    bench.board.cycle();
    answers(&mut bench, START).expect("it starts");
    assert_eq!(runs_from(&mut bench), 1);
    assert_eq!(bench.update_status().state, CONFIRMED);
    assert_eq!(bench.order(Command::GoBack), Ok(()));
    answers(&mut bench, START).expect("it starts");
    assert_eq!(runs_from(&mut bench), 0);
}
