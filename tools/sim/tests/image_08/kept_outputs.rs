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
use crate::fitted::{change, codes, fitted_with, outputs};
use crate::in_slots::{APPLICATION, CHECK, runs_from, signed};
use crate::kept_region::{Contents, region};
use crate::rig::{Rig, adu, file};

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
fn keeping() -> Rig {
    keeping_with(|_| {})
}

/// The same, with changes in its flash.
fn keeping_with(with: impl FnOnce(&mut [u8])) -> Rig {
    let mut stored = vec![(FILTER + INPUT, 0), (COMM_TIMEOUT, 0)];
    stored.extend([0, 1, 2, 8, 9].map(|point| (START + point, AS_IT_WAS)));
    let link = links::of_point(HEATER, false);
    stored.extend([(link, INPUT), (link + 1, LinkAction::Follow.code())]);
    let mut rig = fitted_with(MODULES, &stored, with);
    rig.tolerant = true;
    change(&mut rig, 2, |slot| slot.set_energised(1, true)).unwrap();
    rig.board.run_for(Time::from_ms(1_200));
    rig
}

fn values(rig: &Rig) -> Values {
    let [a, b, _, _] = codes(rig, 3);
    (outputs(rig, 1), [a, b])
}

/// Writes three digital outputs and two analog ones.
fn write(rig: &mut Rig, bits: [bool; 3], words: [u16; 2]) {
    rig.write_bits(0, &bits).unwrap();
    rig.write(ANALOG, &words).unwrap();
    rig.board.run_for(Time::from_ms(20));
}

/// Resets the unit, and runs until the DACs have their values.
fn reset(rig: &mut Rig) {
    rig.board.reset();
    rig.board.run_for(Time::from_ms(250));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn reset_after_any_store_leaves_the_old_or_the_new_outputs() {
    let mut rig = keeping();
    write(&mut rig, [true, false, true], [1234, 77]);
    let old = values(&rig);
    assert_eq!(old, ([true, false, true, true], [1234, 77]));
    let mut contents = Contents(Vec::new());
    // A start.
    rig.board.reset();
    contents.collect(&mut rig, 1_500_000, old, old);
    rig.board.run_for(Time::from_ms(250));
    // STARTED, OWNER and the CRC in both copies. The outputs are what they were.
    assert!(contents.0.len() >= 6, "{} stores", contents.0.len());
    // A write of one output, which is executed a silence after its end.
    let new = ([false, false, true, true], [1234, 77]);
    let now = rig.board.now();
    let end = rig.board.line().send(now, &adu(&[1, 5, 0, 0, 0, 0]));
    rig.board.run_until(end + rig.t35() - Time::from_us(100));
    contents.collect(&mut rig, 60_000, old, new);
    rig.started();
    assert_eq!(values(&rig), new);
    let seen = contents.play(&mut rig, |rig| {
        reset(rig);
        values(rig)
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
fn seal(rig: &mut Rig, with: impl FnOnce(&mut [u32])) {
    let range = region(rig);
    let ram = &mut rig.board.ram_mut()[range];
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
    let mut rig = keeping();
    write(&mut rig, [true, false, true], [1234, 77]);
    // A record.
    rig.board.run_for(Time::from_ms(10_100));
    let stored = ([true, false, true, true], [1234, 77]);
    write(&mut rig, [false, true, true], [1, 2]);
    // The older image ran for some seconds: it wrote the time of its start, and other outputs.
    seal(&mut rig, |words| words[STARTED] += 3);
    reset(&mut rig);
    assert_eq!(values(&rig), stored, "from the record");
    // From now on a reset keeps the outputs again.
    write(&mut rig, [false, true, true], [1, 2]);
    reset(&mut rig);
    assert_eq!(values(&rig), ([false, true, true, true], [1, 2]));
    // Nor do those of an image that never kept outputs.
    seal(&mut rig, |words| words[OWNER] = 0);
    reset(&mut rig);
    assert_eq!(values(&rig).1, [1234, 77]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn outputs_outlast_resets_within_the_first_second() {
    let mut rig = keeping();
    write(&mut rig, [true, false, true], [1234, 77]);
    let before = values(&rig);
    for ms in [30, 90, 600] {
        rig.board.reset();
        rig.board.run_for(Time::from_ms(ms));
    }
    rig.board.run_for(Time::from_ms(200));
    assert_eq!(values(&rig), before);
    // A power-on brings nothing of it back but the record, which was not written.
    rig.power_cycle();
    assert_eq!(values(&rig), ([false; 4], [0; 2]));
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
pub fn put_beside(flash: &mut [u8], image: &[u8]) {
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
        let mut rig = keeping_with(|flash| put_beside(flash, &crashing(handler)));
        write(&mut rig, [true, false, true], [1234, 77]);
        let before = values(&rig);
        let resets = rig.board.resets();
        rig.configure(COMMAND, &[Command::GoBack.code()]);
        rig.board.run_for(CHECK + Time::from_ms(2_000));
        assert_eq!(runs_from(&mut rig), 0, "{handler}");
        let other = rig.register(UPDATE) >> update::OTHER_SHIFT & 0b111;
        let rejected = State::Rejected(Reason::NotConfirmed).code().0;
        assert_eq!(other, u16::from(rejected), "{handler}");
        // The order, and two starts on trial.
        assert!(rig.board.resets() >= resets + 3, "{handler}");
        assert_eq!(values(&rig), before, "{handler}");
    }
}
