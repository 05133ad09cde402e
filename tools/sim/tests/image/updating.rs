//! An update over the line: blocks into the slot that does not run, the orders, and what follows them.

use std::sync::LazyLock;

use register_map::codes::{Baud, Command};
use register_map::configuration::{BAUD, COMM_TIMEOUT, COMMAND, KEY, OPENING_KEY};
use register_map::state::{STACK_FREE, UPDATE};
use register_map::update::{BLOCK_BYTES, Slot, place_of, status};
use sim::line::{Format, Settings};
use sim::{Module, Time};

use crate::LAYOUT;
use crate::bench::{Bench, PAGE_SIZE, SLOT, adu};
use crate::in_slots::{
    APPLICATION, CHECK, HASH, LENGTH, SIGNATURE, START, answers, answers_as, fitted, flash,
    holding, image, runs_from, sign, signed, unit, with_crc,
};
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
fn unit_of(slots: [&[u8]; 2]) -> Bench {
    let mut bench = unit(slots, &[(BAUD, Baud::B921600.code())]);
    bench.settings(FAST);
    answers(&mut bench, CHECK + START).expect("it starts");
    // A reply waits for the erase of a page.
    bench.patience = ERASE;
    bench
}

/// Returns a unit that runs from slot A, and has nothing in slot B.
fn running() -> Bench {
    unit_of([&image(0), &[]])
}

/// Runs until the unit answers after an update, and returns how it then stands.
fn after(bench: &mut Bench) -> (usize, Status) {
    // The order is carried out after its reply.
    bench.board.run_for(Time::from_ms(20));
    answers(bench, CHECK + START).expect("it starts");
    (runs_from(bench), bench.update_status())
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_new_image_starts_and_serves_and_stays_once_it_is_confirmed() {
    let mut bench = running();
    assert_eq!(bench.update_status().slot, 1);
    bench.prepare();
    bench.send(Slot::B, &image(1));
    bench.board.run_for(ERASE);
    let free = bench.register(STACK_FREE);
    assert!(free >= 1024, "{free} bytes of stack");
    assert_eq!(bench.order(Command::Finish), Ok(()));
    let from = bench.board.now();
    let (slot, _) = after(&mut bench);
    println!("out of service for {:?}", bench.board.now() - from);
    assert_eq!(slot, 1);
    assert_eq!(bench.register(UPDATE) & 0b10_0011, 0b10_0010, "on trial");
    assert_eq!(bench.order(Command::Prepare), Err(6));
    assert_eq!(bench.order(Command::GoBack), Err(6));
    assert_eq!(bench.order(Command::Confirm), Ok(()));
    bench.board.run_for(ERASE);
    assert_eq!(bench.register(UPDATE), 0b1_0110, "confirmed, as the other");
    bench.board.cycle();
    assert_eq!(after(&mut bench).0, 1);
    // The way back takes the same trial.
    assert_eq!(bench.order(Command::GoBack), Ok(()));
    assert_eq!(after(&mut bench).0, 0);
    assert_eq!(bench.register(UPDATE) & 0b10_0011, 0b10_0001, "on trial");
    assert_eq!(bench.order(Command::Confirm), Ok(()));
    bench.board.run_for(ERASE);
    assert_eq!(bench.register(UPDATE), 0b1_0101);
}

/// The flash of a unit that has taken the image for slot B, and whose loader has not checked it yet.
static NEW: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut bench = running();
    bench.update(&image(1));
    while bench.board.pc() >= LAYOUT.board.layout().slots[0] {
        bench.board.run_for(Time::from_us(20));
    }
    bench.board.flash().to_vec()
});

/// The flash of a unit that runs from slot B since an update, with a confirmed image in slot A.
static UPDATED: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut bench = starting(NEW.clone());
    assert_eq!(after(&mut bench).0, 1);
    assert_eq!(bench.order(Command::Confirm), Ok(()));
    bench.board.run_for(ERASE);
    bench.board.flash().to_vec()
});

/// Returns a unit that is powered now, with this flash.
fn starting(flash: Vec<u8>) -> Bench {
    let mut bench = holding(flash, 1);
    bench.settings(FAST);
    bench.patience = ERASE;
    bench
}

/// Returns the unit of [`NEW`] with bytes changed in the image.
fn with_changes(changes: &[u8]) -> Bench {
    let mut flash = NEW.clone();
    let b = (LAYOUT.board.layout().slots[1] - 0x0800_0000) as usize;
    flash[b..b + changes.len()].copy_from_slice(changes);
    starting(flash)
}

/// Returns images for slot B that the loader refuses, each with the reason.
fn refused_images() -> [(&'static str, u16, Vec<u8>); 7] {
    let with = |at: usize, bits: u8| {
        let mut image = image(1);
        image[at] ^= bits;
        image
    };
    let whole = |mut image: Vec<u8>| {
        with_crc(&mut image);
        image
    };
    let signed = |mut image: Vec<u8>| {
        sign(&mut image);
        image
    };
    [
        ("version", 8, whole(with(9, 1))),
        ("commit", 8, whole(with(24, 1))),
        ("signature", 8, with(SIGNATURE, 1)),
        ("key of somebody else", 8, with(SIGNATURE + 63, 0x10)),
        ("signed, but another hash", 7, signed(with(HASH, 1))),
        ("signed, but other code", 7, signed(with(20_000, 0x80))),
        ("last byte", 7, whole(with(image(1).len() - 1, 1))),
    ]
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn an_image_that_is_not_genuine_is_refused_and_the_old_one_runs() {
    for (what, reason, image) in refused_images() {
        let mut bench = with_changes(&image);
        let (slot, status) = after(&mut bench);
        let refused = (slot, status.state, status.reason);
        assert_eq!(refused, (0, REJECTED, reason), "{what}");
        assert_eq!(bench.order(Command::GoBack), Err(6), "{what}");
        assert_eq!(bench.order(Command::Finish), Err(6), "{what}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn an_image_that_is_not_intact_is_refused_without_a_restart() {
    let mut bench = running();
    let last = image(1).len() - 1;
    let changed = |at: usize| {
        let mut image = image(1);
        image[at] ^= 1;
        image
    };
    for (what, reason, image) in [("code", 6, changed(last)), ("zero area", 1, changed(511))] {
        bench.prepare();
        bench.send(Slot::B, &image);
        bench.board.run_for(ERASE);
        assert_eq!(bench.order(Command::Finish), Ok(()));
        bench.board.run_for(ERASE);
        let status = bench.update_status();
        assert_eq!((status.state, status.reason), (1, reason), "{what}");
        assert_eq!(status.missing, status.blocks, "{what}");
        assert_eq!(bench.board.resets(), 1, "that of the first start");
    }
    // What is right already is not written again.
    bench.send(Slot::B, &image(1));
    bench.board.run_for(ERASE);
    assert_eq!(bench.update_status().missing, 0);
    assert_eq!(bench.order(Command::Finish), Ok(()));
    assert_eq!(after(&mut bench).0, 1);
}

/// The unit has been updated once, so both slots hold a confirmed image, and B runs.
fn updated(bench: &mut Bench, image: &[u8]) {
    bench.update(image);
    assert_eq!(after(bench).0, 1);
    assert_eq!(bench.order(Command::Confirm), Ok(()));
    bench.board.run_for(ERASE);
}

/// Attack: a slot that was confirmed is prepared and filled with code that is not signed, and then chosen in every way.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn code_that_is_not_signed_is_never_started() {
    let mut bench = starting(UPDATED.clone());
    assert_eq!(after(&mut bench).0, 1);
    // Slot A was confirmed.
    let mut forged = image(0);
    forged[20_000] ^= 1;
    with_crc(&mut forged);
    bench.prepare();
    bench.send(Slot::A, &forged);
    bench.board.run_for(ERASE);
    assert_eq!(bench.order(Command::GoBack), Err(6));
    let mut switched = holding(bench.board.flash().to_vec(), 254);
    switched.patience = ERASE;
    answers_as(&mut switched, 255, START).expect("it starts");
    assert_eq!(runs_from(&mut switched), 1);
    // The image that runs is damaged.
    let mut flash = bench.board.flash().to_vec();
    let b = (LAYOUT.board.layout().slots[1] - 0x0800_0000) as usize;
    flash[b + 20_000] ^= 1;
    let mut damaged = holding(flash, 1);
    damaged.board.run_for(CHECK);
    assert!(damaged.board.leds().fault && damaged.board.pc() < LAYOUT.board.layout().slots[0]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn an_image_of_an_older_epoch_is_never_started() {
    let epoch = |slot, epoch| signed(slot, |image| image[6] = epoch);
    let mut bench = unit_of([&epoch(0, 2), &[]]);
    assert_eq!(
        bench.records(5, 1),
        [2],
        "the floor is that of the first image"
    );
    bench.update(&epoch(1, 1));
    let (slot, status) = after(&mut bench);
    assert_eq!((slot, status.state, status.reason), (0, REJECTED, 5));
    updated(&mut bench, &epoch(1, 3));
    assert_eq!(bench.records(5, 1), [3]);
    // The image in slot A is confirmed, and below the floor now.
    assert_eq!(bench.update_status().state, CONFIRMED);
    assert_eq!(bench.order(Command::GoBack), Err(6));
    let mut switched = holding(bench.board.flash().to_vec(), 254);
    answers_as(&mut switched, 255, START).expect("it starts");
    assert_eq!(runs_from(&mut switched), 1);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn switch_254_starts_the_other_image_until_the_next_power_on_or_an_order() {
    let mut switched = holding(UPDATED.clone(), 254);
    switched.patience = ERASE;
    for asked in [true, false] {
        answers_as(&mut switched, 255, START).expect("it starts");
        assert_eq!(runs_from(&mut switched), 0);
        let register = switched.ask(255, &[3, 2, 0x2A, 0, 1]);
        assert_eq!(register.as_deref(), Some(&[3, 2, 0, 0b101_0101][..]));
        // A restart keeps the choice, whatever the reason.
        if asked {
            let _ = switched.ask(255, &[6, 1, 0, 0x5A, 0x17]);
            let _ = switched.ask(255, &[6, 1, 8, 0, 2]);
        } else {
            switched.board.reset();
        }
        switched.board.run_for(Time::from_ms(20));
    }
    answers_as(&mut switched, 255, START).expect("it starts");
    assert_eq!(runs_from(&mut switched), 0);
    let _ = switched.ask(255, &[6, 1, 0, 0x5A, 0x17]);
    let _ = switched.ask(255, &[6, 1, 8, 0xB0, 3]);
    switched.board.run_for(ERASE);
    switched.board.reset();
    answers_as(&mut switched, 255, START).expect("it starts");
    assert_eq!(runs_from(&mut switched), 0, "it is preferred now");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn command_b007_restarts_once_as_with_switch_255() {
    let mut bench = running();
    assert_eq!(bench.order(Command::RestartAs255), Ok(()));
    bench.board.run_for(Time::from_ms(20));
    bench.settings(Settings::default());
    answers_as(&mut bench, 255, START).expect("it starts");
    bench.board.reset();
    bench.settings(FAST);
    answers(&mut bench, START).expect("it starts");
}

/// Patches code at the reset vector's target.
fn at_reset(code: &'static [u8]) -> impl FnOnce(&mut [u8]) {
    move |image| {
        let vector = &image[APPLICATION + 4..APPLICATION + 8];
        let vector = u32::from_le_bytes(vector.try_into().unwrap()) & !1;
        let at = APPLICATION + (vector - LAYOUT.board.layout().slots[1]) as usize - 512;
        image[at..at + code.len()].copy_from_slice(code);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn an_image_that_hangs_or_faults_is_rolled_back_without_help() {
    // An endless loop, and an undefined instruction.
    for code in [&[0xFE, 0xE7][..], &[0x00, 0xDE]] {
        let mut bench = with_changes(&signed(1, at_reset(code)));
        // Two starts on trial, each up to the loader's watchdog, 8 s at 40 kHz, 14 s at 30 kHz.
        bench.board.run_for(Time::from_ms(20));
        answers(&mut bench, CHECK + Time::from_ms(30_000)).expect("the old one serves");
        let status = bench.update_status();
        assert_eq!(runs_from(&mut bench), 0);
        assert_eq!((status.state, status.reason), (REJECTED, 10));
        // It may be tried again.
        assert_eq!(bench.order(Command::Finish), Ok(()));
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn an_image_that_nobody_confirms_is_rolled_back_after_15_minutes_each_start() {
    let mut bench = starting(NEW.clone());
    assert_eq!(after(&mut bench).0, 1);
    let minutes = |bench: &mut Bench, minutes: u64| {
        bench.board.run_for(Time::from_ms(60_000 * minutes));
        runs_from(bench)
    };
    assert_eq!(minutes(&mut bench, 14), 1);
    assert_eq!(minutes(&mut bench, 2), 1, "the second start");
    assert_eq!(minutes(&mut bench, 15), 0);
    let (_, status) = after(&mut bench);
    assert_eq!((status.state, status.reason), (REJECTED, 10));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn power_cut_during_the_check_needs_only_the_order_again() {
    let mut bench = starting(NEW.clone());
    bench.board.run_for(Time::from_ms(700));
    assert!(
        bench.board.pc() < LAYOUT.board.layout().slots[0],
        "it checks"
    );
    bench.board.cycle();
    let (slot, status) = after(&mut bench);
    assert_eq!((slot, status.state, status.reason), (0, REJECTED, 9));
    assert_eq!(bench.order(Command::Finish), Ok(()));
    assert_eq!(after(&mut bench).0, 1);
}

/// Attack: the header of a new image is changed behind the application's back, with absurd bounds.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn absurd_bounds_in_a_new_header_are_refused() {
    for (at, number, reason) in [
        (LENGTH, 0xFFFF_FFFC_u32, 4),
        (LENGTH, 0x8000_0000, 4),
        (LENGTH, 0, 4),
        (LENGTH, 54 * 1024, 4),
        (LENGTH - 4, 0xFFFF_FE00, 3),
        (LENGTH - 4, 0x2000_0000, 3),
    ] {
        let mut header = image(1)[..APPLICATION].to_vec();
        header[at..at + 4].copy_from_slice(&number.to_le_bytes());
        let mut bench = with_changes(&header);
        let (slot, status) = after(&mut bench);
        let refused = (slot, status.state, status.reason);
        assert_eq!(refused, (0, REJECTED, reason), "{number:#x} at {at}");
    }
}

/// The slowest flash, writes of outputs all the time, and blocks faster than they are programmed.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_watchdog_is_refreshed_whatever_a_master_sends_during_an_update() {
    let stored = [(BAUD, Baud::B921600.code())];
    let module = Module::Do4;
    let mut bench = fitted(flash([&image(0), &[]], module, &stored), module, 1);
    bench.settings(FAST);
    answers(&mut bench, CHECK + START).expect("it starts");
    bench.patience = ERASE;
    bench.board.set_flash_durations(SLOWEST);
    assert_eq!(bench.order(Command::Prepare), Ok(()));
    let mut on = false;
    while bench.update_status().pages > 0 {
        for _ in 0..20 {
            on = !on;
            bench.write_bit(SLOT, on).unwrap();
        }
    }
    let silence = bench.t35() + bench.characters(1);
    let mut now = bench.board.now();
    for (number, block) in (0..).zip(image(1).chunks(BLOCK_BYTES)) {
        let (file, record) = place_of(Slot::B, number);
        let [[f1, f0], [r1, r0]] = [file, record].map(u16::to_be_bytes);
        let mut bytes = vec![0, 0x15, 135, 6, f1, f0, r1, r0, 0, 64];
        bytes.extend(block);
        bytes.resize(10 + BLOCK_BYTES, 0xFF);
        now = bench.board.line().send(now, &adu(&bytes)) + silence;
        bench.board.run_until(now);
    }
    bench.board.run_for(ERASE);
    let status = bench.update_status();
    assert!(
        status.missing > 0 && status.missing < status.blocks,
        "{status:?}"
    );
    assert_eq!(bench.board.resets(), 1, "that of the first start");
}

/// Points are read and outputs written all the time, at every kind of rate; a reply waits for the erase of a page at
/// most, which is what [`Bench::ask`] allows.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_points_are_served_and_no_byte_is_lost_during_an_update() {
    for baud in [Baud::B9600, Baud::B115200, Baud::B921600] {
        let stored = [(BAUD, baud.code())];
        let slots = [&image(0)[..], &[]];
        let mut bench = fitted(flash(slots, Module::Do4, &stored), Module::Do4, 1);
        bench.settings(Settings {
            baud: baud.bits_per_second(),
            ..Settings::default()
        });
        answers(&mut bench, CHECK + START).expect("it starts");
        bench.patience = ERASE;
        bench.configure(COMM_TIMEOUT, &[3]);
        bench.write_bits(SLOT, &[true, false, true, false]).unwrap();
        bench.board.run_for(Time::from_ms(10));
        (0..3).for_each(|pin| bench.board.watch_pin('A', pin));
        let mut switches = 0;
        let mut serve = |bench: &mut Bench| {
            switches += 1;
            let on = switches % 2 == 0;
            bench.write_bit(SLOT + 3, on).unwrap();
            let all = Ok(vec![true, false, true, on]);
            assert_eq!(bench.bits(1, SLOT, 4), all, "{baud:?}");
        };
        assert_eq!(bench.order(Command::Prepare), Ok(()));
        while bench.update_status().pages > 0 {
            serve(&mut bench);
        }
        for (number, block) in (0..20).zip(image(1).chunks(BLOCK_BYTES)) {
            while bench.block(Slot::B, number, block).is_err() {}
            serve(&mut bench);
        }
        for pin in 0..3 {
            assert_eq!(bench.board.pin_edges('A', pin), [], "{baud:?}");
        }
        // Errors, no response, overruns.
        let counted = [0x0231, 0x0234, 0x0237].map(|address| bench.register(address));
        assert_eq!(counted, [0; 3], "{baud:?}");
        assert!(switches > 20, "{switches}");
        // The communication watchdog trips at its time although a page is being erased.
        assert_eq!(bench.order(Command::Prepare), Ok(()));
        let last = bench.sent;
        bench.board.run_for(Time::from_ms(400));
        let edges = bench.board.pin_edges('A', 0);
        let &[(at, false)] = edges else {
            panic!("the output did not go off: {edges:?}");
        };
        let took = at - last;
        let due = Time::from_ms(298)..Time::from_ms(302) + ERASE;
        assert!(due.contains(&took), "{took:?}");
    }
}

/// A change of the flash: a page erased, or a half-word programmed.
#[derive(Clone)]
enum Change {
    Erased(usize),
    Programmed(usize, [u8; 2]),
}

/// Returns the changes that made `after` of `before`, in their order: pages from the last one on, then half-words.
fn changes(before: &[u8], after: &[u8]) -> Vec<Change> {
    let pages = before.chunks(PAGE_SIZE).zip(after.chunks(PAGE_SIZE));
    let gains = |(before, after): &(&[u8], &[u8])| {
        let mut bytes = before.iter().zip(*after);
        bytes.any(|(before, after)| after & !before != 0)
    };
    let erased: Vec<usize> = (0..)
        .zip(pages)
        .filter(|(_, pair)| gains(pair))
        .map(|(n, _)| n)
        .collect();
    let mut now = before.to_vec();
    for page in &erased {
        now[page * PAGE_SIZE..][..PAGE_SIZE].fill(0xFF);
    }
    let halves = now.chunks(2).zip(after.chunks(2)).enumerate();
    let programmed = halves.filter(|(_, (now, after))| now != after);
    let programmed =
        programmed.map(|(n, (_, after))| Change::Programmed(2 * n, [after[0], after[1]]));
    let erased = erased.into_iter().rev().map(Change::Erased);
    erased.chain(programmed).collect()
}

/// Changes a flash, completely or, with a seed, as a power cut leaves it: some bits have changed.
fn change(flash: &mut [u8], change: &Change, cut: Option<u64>) {
    let mut noise = cut.unwrap_or_default() | 1;
    let mut random = || {
        noise = noise
            .wrapping_mul(0x5851_F42D_4C95_7F2D)
            .wrapping_add(0x1405_7B7E_F767_814F);
        if cut.is_none() {
            0
        } else {
            (noise >> 56) as u8
        }
    };
    match change {
        Change::Erased(page) => {
            let bytes = &mut flash[page * PAGE_SIZE..][..PAGE_SIZE];
            bytes.iter_mut().for_each(|byte| *byte |= !random());
        }
        Change::Programmed(at, bytes) => {
            for (byte, new) in flash[*at..at + 2].iter_mut().zip(bytes) {
                *byte = (*byte & random()) | new;
            }
        }
    }
}

/// A whole update, from the order to prepare to the confirmation: the flash before it, and its changes.
fn recorded() -> (Vec<u8>, Vec<Change>) {
    // Something to erase is in slot B.
    let mut bench = unit_of([&image(0), &image(1)]);
    let first = bench.board.flash().to_vec();
    let (mut before, mut all) = (first.clone(), Vec::new());
    let mut note = |bench: &Bench| {
        let after = bench.board.flash();
        if before != after {
            all.extend(changes(&before, after));
            before = after.to_vec();
        }
    };
    assert_eq!(bench.order(Command::Prepare), Ok(()));
    note(&bench);
    while bench.update_status().pages > 0 {
        note(&bench);
    }
    for (number, block) in (0..).zip(image(1).chunks(BLOCK_BYTES)) {
        while bench.block(Slot::B, number, block).is_err() {}
        note(&bench);
    }
    bench.board.run_for(ERASE);
    assert_eq!(bench.order(Command::Finish), Ok(()));
    let end = bench.board.now() + CHECK;
    while bench.board.now() < end {
        bench.board.run_for(Time::from_ms(1));
        note(&bench);
    }
    assert_eq!(bench.order(Command::Confirm), Ok(()));
    bench.board.run_for(ERASE);
    note(&bench);
    assert_eq!(runs_from(&mut bench), 1);
    (first, all)
}

/// `MODIO_CUTS` is the number of cuts, 200 without it; every change of the boot state and every erase is among them.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_power_cut_in_any_flash_operation_of_an_update_leaves_a_unit_that_serves() {
    let (mut flash, all) = recorded();
    let cuts = std::env::var("MODIO_CUTS").map_or(200, |cuts| cuts.parse().unwrap());
    let boot = (LAYOUT.board.layout().boot.first - 0x0800_0000) as usize;
    let always = |change: &Change| match change {
        Change::Erased(_) => true,
        Change::Programmed(at, _) => *at >= boot,
    };
    let rare = all.iter().filter(|change| always(change)).count();
    let step = (all.len() - rare) / usize::max(cuts, rare + 1).saturating_sub(rare).max(1);
    println!(
        "{} operations, {rare} of them each, of the others one in {step}",
        all.len()
    );
    let (mut starts, mut passed) = ([0, 0], 0);
    for (n, next) in all.iter().enumerate() {
        passed += usize::from(!always(next));
        if always(next) || passed.is_multiple_of(step) {
            let mut cut = flash.clone();
            change(&mut cut, next, Some(n as u64));
            let mut bench = starting(cut);
            let (slot, _) = after(&mut bench);
            starts[slot] += 1;
            // It can be updated, or confirmed first.
            if bench.register(UPDATE) & 1 << 5 != 0 {
                assert_eq!(bench.order(Command::Confirm), Ok(()), "cut {n}");
                bench.board.run_for(ERASE);
            }
            assert_eq!(bench.order(Command::Prepare), Ok(()), "cut {n}");
        }
        change(&mut flash, next, None);
    }
    println!("started from A and B: {starts:?}");
    assert!(starts[0] > 100 && starts[1] > 10, "{starts:?}");
}
