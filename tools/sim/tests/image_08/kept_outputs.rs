//! What a reset that is not a power-on keeps of the outputs: a reset after any store leaves the old values or the new ones,
//! and those of another image do not count.

use register_map::codes::{Command, LinkAction};
use register_map::configuration::{AS_IT_WAS, COMM_TIMEOUT, COMMAND, FILTER, START};
use register_map::links;
use register_map::part::FLASH_BASE;
use register_map::state::{UPDATE, update};
use register_map::update::{Reason, State, crc32};
use sim::{Image, Module, Time};

use crate::LAYOUT;
use crate::bench::{Bench, adu, file};
use crate::fitted::{change, codes, fitted_with, outputs};
use crate::in_slots::{APPLICATION, CHECK, runs_from, signed};
use crate::kept_region::{Contents, region};

const MODULES: [Module; 4] = [Module::Do4, Module::Di4, Module::Ao4, Module::None];
/// An output with START = 0 that follows an input, and the input.
const HEATER: u16 = 3;
const INPUT: u16 = 4;
const ANALOG: u16 = 8;

/// Words of a copy of the sealed part, and the words STARTED and OWNER.
const COPY: usize = 16;
const STARTED: usize = 9;
const OWNER: usize = 11;

/// The digital outputs, and the first two analog ones.
type Values = ([bool; 4], [u16; 2]);

/// Returns a unit whose outputs start as they were, but for one that a link holds on.
fn keeping() -> Bench {
    keeping_with(|_| {})
}

/// The same, with changes in its flash.
fn keeping_with(with: impl FnOnce(&mut [u8])) -> Bench {
    let mut stored = vec![(FILTER + INPUT, 0), (COMM_TIMEOUT, 0)];
    stored.extend([0, 1, 2, 8, 9].map(|point| (START + point, AS_IT_WAS)));
    let link = links::of_point(HEATER, false);
    stored.extend([(link, INPUT), (link + 1, LinkAction::Follow.code())]);
    let mut bench = fitted_with(MODULES, &stored, with);
    bench.tolerant = true;
    change(&mut bench, 2, |slot| slot.set_energised(1, true)).unwrap();
    bench.board.run_for(Time::from_ms(1_200));
    bench
}

fn values(bench: &Bench) -> Values {
    let [a, b, _, _] = codes(bench, 3);
    (outputs(bench, 1), [a, b])
}

/// Writes three digital outputs and two analog ones.
fn write(bench: &mut Bench, bits: [bool; 3], words: [u16; 2]) {
    bench.write_bits(0, &bits).unwrap();
    bench.write(ANALOG, &words).unwrap();
    bench.board.run_for(Time::from_ms(20));
}

/// Resets the unit, and runs until the DACs have their values.
fn reset(bench: &mut Bench) {
    bench.board.reset();
    bench.board.run_for(Time::from_ms(250));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn reset_after_any_store_leaves_the_old_or_the_new_outputs() {
    let mut bench = keeping();
    write(&mut bench, [true, false, true], [1234, 77]);
    let old = values(&bench);
    assert_eq!(old, ([true, false, true, true], [1234, 77]));
    let mut contents = Contents(Vec::new());
    // A start.
    bench.board.reset();
    contents.collect(&mut bench, 1_500_000, old, old);
    bench.board.run_for(Time::from_ms(250));
    // STARTED, OWNER and the CRC in both copies. The outputs are what they were.
    assert!(contents.0.len() >= 6, "{} stores", contents.0.len());
    // A write of one output, which is executed a silence after its end.
    let new = ([false, false, true, true], [1234, 77]);
    let now = bench.board.now();
    let end = bench.board.line().send(now, &adu(&[1, 5, 0, 0, 0, 0]));
    bench
        .board
        .run_until(end + bench.t35() - Time::from_us(100));
    contents.collect(&mut bench, 60_000, old, new);
    bench.started();
    assert_eq!(values(&bench), new);
    let seen = contents.play(&mut bench, |bench| {
        reset(bench);
        values(bench)
    });
    assert_eq!(seen, [old, new]);
}

/// CRC-32 of the part's unit.
fn crc(words: &[u32]) -> u32 {
    words.iter().fold(u32::MAX, |crc, word| {
        (0..32).fold(crc ^ word, |crc, _| {
            crc << 1 ^ if crc >> 31 == 0 { 0 } else { 0x04C1_1DB7 }
        })
    })
}

/// Changes the sealed part as another image may.
fn seal(bench: &mut Bench, with: impl FnOnce(&mut [u32])) {
    let range = region(bench);
    let ram = &mut bench.board.ram_mut()[range];
    let mut words: Vec<u32> = ram[..4 * COPY]
        .chunks(4)
        .map(|b| u32::from_le_bytes(b.try_into().unwrap()))
        .collect();
    assert_eq!(crc(&words), 0, "the sealed part is valid");
    with(&mut words);
    words[COPY - 1] = crc(&words[..COPY - 1]);
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    ram[..4 * COPY].copy_from_slice(&bytes);
    ram[4 * COPY..8 * COPY].copy_from_slice(&bytes);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn outputs_of_a_run_before_an_older_image_do_not_return() {
    let mut bench = keeping();
    write(&mut bench, [true, false, true], [1234, 77]);
    // A record.
    bench.board.run_for(Time::from_ms(10_100));
    let stored = ([true, false, true, true], [1234, 77]);
    write(&mut bench, [false, true, true], [1, 2]);
    // The older image ran for some seconds: it wrote the time of its start, and other outputs.
    seal(&mut bench, |words| words[STARTED] += 3);
    reset(&mut bench);
    assert_eq!(values(&bench), stored, "from the record");
    // From now on a reset keeps the outputs again.
    write(&mut bench, [false, true, true], [1, 2]);
    reset(&mut bench);
    assert_eq!(values(&bench), ([false, true, true, true], [1, 2]));
    // Nor do those of an image that never kept outputs.
    seal(&mut bench, |words| words[OWNER] = 0);
    reset(&mut bench);
    assert_eq!(values(&bench).1, [1234, 77]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn outputs_outlast_resets_within_the_first_second() {
    let mut bench = keeping();
    write(&mut bench, [true, false, true], [1234, 77]);
    let before = values(&bench);
    for ms in [30, 90, 600] {
        bench.board.reset();
        bench.board.run_for(Time::from_ms(ms));
    }
    bench.board.run_for(Time::from_ms(200));
    assert_eq!(values(&bench), before);
    // A power-on brings nothing of it back but the record, which was not written.
    bench.power_cycle();
    assert_eq!(values(&bench), ([false; 4], [0; 2]));
}

/// Returns the image for slot B with an undefined instruction at the beginning of a handler.
fn crashing(handler: &str) -> Vec<u8> {
    let image = Image::read(&file("modio-b")).expect("the image can be read");
    let address = image.symbol(handler).expect("it has the handler") & !1;
    let code = LAYOUT.board.layout().slots[1] + APPLICATION as u32;
    let at = APPLICATION + (address - code) as usize;
    signed(1, |image| image[at..at + 2].copy_from_slice(&[0x00, 0xDE]))
}

/// Writes an image into slot B, and that it is confirmed, too, into the first record of the boot state.
fn put_beside(flash: &mut [u8], image: &[u8]) {
    let layout = LAYOUT.board.layout();
    let slot = (layout.slots[1] - FLASH_BASE) as usize;
    flash[slot..slot + image.len()].copy_from_slice(image);
    let boot = (layout.boot.first - FLASH_BASE) as usize;
    let record = &mut flash[boot..boot + 16];
    // The states of both slots, 4 bits each.
    record[5] |= record[5] << 4;
    let crc = crc32([&record[..12], &[]]);
    record[12..].copy_from_slice(&crc.to_le_bytes());
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn outputs_outlast_a_trial_image_that_crashes_at_each_start() {
    // At its first instruction, in its first scan, and in its background, which comes later.
    for handler in ["Reset", "EXTI1", "EXTI0"] {
        let mut bench = keeping_with(|flash| put_beside(flash, &crashing(handler)));
        write(&mut bench, [true, false, true], [1234, 77]);
        let before = values(&bench);
        let resets = bench.board.resets();
        bench.configure(COMMAND, &[Command::GoBack.code()]);
        bench.board.run_for(CHECK + Time::from_ms(2_000));
        assert_eq!(runs_from(&mut bench), 0, "{handler}");
        let other = bench.register(UPDATE) >> update::OTHER_SHIFT & 0b111;
        let rejected = State::Rejected(Reason::NotConfirmed).code().0;
        assert_eq!(other, u16::from(rejected), "{handler}");
        // The order, and two starts on trial.
        assert!(bench.board.resets() >= resets + 3, "{handler}");
        assert_eq!(values(&bench), before, "{handler}");
    }
}
