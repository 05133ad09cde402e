//! Power cuts: at every flash operation of a save and of the start after it, and at any instant under traffic. After
//! the cut, the configuration is completely the old or completely the new one, and the device still works.
//!
//! Every state that a cut may leave in the cells is tested on the host, in `firmware/tests/store`.

use fastrand::Rng;
use sim::{Channel, Module, Time};

use crate::rig::{FIRST, GOOD_MV, LOW_MV, PAGE_ADDRESSES, PAGE_SIZE, PORT, Rig, SLOT, adu, pages};

const FILTER: u16 = 0x0120 + SLOT;
const BETA: u16 = 0x0160;
const INVALID: u16 = 2;
/// Progress of the operation when the power fails. Each fraction leaves other cells unstable.
const FRACTIONS: [f64; 4] = [0.0, 0.5, 0.75, 1.0];
/// Number of half-words of the record that these tests save: head, six pairs, CRC, seals.
const HALF_WORDS: u64 = 21;
/// Bytes of a record with 32 more pairs.
const LARGE_RECORD: usize = (HALF_WORDS as usize + 64) * 2;
/// Number of operations that prepare a spare page: destroy its mark, erase, write the mark.
const ERASE: u64 = 3;
/// Number of saves that may fail in a row: the place for the record may not read as erased; then the next is used.
const TRIES: usize = 2;
/// A save takes 2 ms, at the slow corner up to 20 ms. An erase before it or after it waits for the watchdog, up to 100 ms,
/// and takes 30 ms more, during which the unit does not serve the line.
const SAVE: Time = Time::from_ms(200);
/// Number of starts after a cut. Unstable cells read differently at each start.
const STARTS: usize = 2;

fn rig() -> Rig {
    let mut rig = Rig::set_up(Module::Di4, &[(0x0101, 1152)]);
    rig.tolerant = true;
    rig
}

/// Returns four settings that no other round has.
fn set(round: u16) -> [u16; 4] {
    [0, 1, 2, 3].map(|n| 10 + (round * 4 + n) % 900)
}

/// Saves these settings. The lock must be open.
fn save(rig: &mut Rig, values: [u16; 4]) {
    rig.write(FILTER, &values).unwrap();
    for _ in 0..TRIES {
        rig.write(0x0108, &[1]).unwrap();
        rig.board.run_for(SAVE);
        if !rig.status(8) {
            return;
        }
    }
    panic!("{values:?} are not saved");
}

/// Returns the number of erased bytes at the end of each of the store's pages.
fn rooms(rig: &Rig) -> [usize; 2] {
    let flash = rig.board.flash();
    pages().map(|page| {
        let bytes = flash[page].iter().rev();
        bytes.take_while(|byte| **byte == 0xFF).count()
    })
}

/// Returns the set that is stored after a cut, which must be one of `sets`. Asserts that the rest of the device is in
/// order.
fn after_cut(rig: &mut Rig, sets: &[[u16; 4]], what: &str) -> [u16; 4] {
    let mut first = None;
    for start in 0..STARTS {
        rig.board.power_on();
        rig.started();
        let values = rig.registers(FILTER, 4).unwrap();
        assert!(!rig.status(INVALID), "{what}: the store is not damaged");
        assert_eq!(rig.registers(0x0101, 2), Ok(vec![1152, 0]), "{what}");
        assert_eq!(rig.register(0x020F + PORT), 1, "{what}");
        assert_eq!(
            first.get_or_insert_with(|| values.clone()),
            &values,
            "{what}: start {start} finds another configuration"
        );
        if start + 1 < STARTS {
            rig.board.power_off();
            rig.board.run_for(Time::from_ms(10));
        }
    }
    let values = first.unwrap_or_default();
    let found = sets.iter().find(|set| set[..] == values);
    *found.unwrap_or_else(|| panic!("{what}: {values:?} is none of {sets:?}"))
}

/// Cuts the power in every operation of a save, each at another of the four instants. `prepare` brings the store to
/// its state before the save and returns the stored settings. Returns the number of operations of the save.
fn every_cut_of_a_save(
    rig: &mut Rig,
    mut prepare: impl FnMut(&mut Rig, [u16; 4]) -> [u16; 4],
) -> u64 {
    let mut stored = [5; 4];
    let mut changed = 0;
    for operation in 1.. {
        let old = prepare(rig, stored);
        // No settings that `fill` saves.
        let new = set(100 + operation as u16);
        rig.configure(FILTER, &new);
        let fraction = FRACTIONS[operation as usize % FRACTIONS.len()];
        rig.board.cut_in_flash_operation(operation, fraction);
        rig.write(0x0108, &[1]).unwrap();
        // The save may have waited for the supply.
        rig.board.run_for(Time::from_ms(20));
        rig.board.set_supply_mv(GOOD_MV).unwrap();
        rig.board.run_for(Time::from_ms(300));
        if rig.board.powered() {
            assert!(changed > 0 && changed < operation - 1, "{changed} changed");
            return operation - 1;
        }
        let what = format!("operation {operation}, {fraction} of it");
        stored = after_cut(rig, &[old, new], &what);
        changed += u64::from(stored == new);
    }
    unreachable!()
}

/// Returns the content of the store's pages.
fn store(rig: &Rig) -> Vec<u8> {
    let [first, second] = pages();
    rig.board.flash()[first.start..second.end].to_vec()
}

/// Switches the power off and gives the store's pages this content.
fn restore(rig: &mut Rig, content: &[u8]) {
    rig.board.power_off();
    let [first, _] = PAGE_ADDRESSES;
    rig.board.patch_code(first, content).unwrap();
}

/// Saves until the page in use has no room for another record. The other page is then spare. Returns the last
/// settings.
fn fill(rig: &mut Rig) -> [u16; 4] {
    let mut round = 0;
    // Both pages have records or a mark; the page with more bytes is in use. Large records come first, because only
    // twenty saves are possible together.
    while rooms(rig).iter().min() >= Some(&LARGE_RECORD) {
        round += 1;
        rig.write(BETA, &[2000 + round % 900; 32]).unwrap();
        save(rig, set(round));
    }
    rig.write(BETA, &[3950; 32]).unwrap();
    while rooms(rig).iter().min() >= Some(&(HALF_WORDS as usize * 2)) {
        round += 1;
        save(rig, set(round));
    }
    set(round)
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_any_operation_of_a_save_after_the_last_record() {
    let operations = every_cut_of_a_save(&mut rig(), |rig, stored| {
        rig.unlock();
        stored
    });
    // The record alone, or with the erase of the other page.
    assert!(
        (HALF_WORDS..=HALF_WORDS + ERASE).contains(&operations),
        "{operations}"
    );
}

/// A save that is requested while the supply is too low, when neither page has room. The start could not erase the page
/// that is not in use, so the save has to erase it when the supply is back, and the old page after the record.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_any_operation_of_a_save_that_has_to_erase() {
    let mut rig = rig();
    rig.unlock();
    let last = fill(&mut rig);
    let spare = rooms(&rig)
        .iter()
        .position(|room| *room >= PAGE_SIZE - 24)
        .expect("a spare page");
    let mut content = store(&rig);
    content[spare * PAGE_SIZE..][..PAGE_SIZE].fill(0);
    let operations = every_cut_of_a_save(&mut rig, |rig, _| {
        restore(rig, &content);
        rig.board.set_supply_mv(LOW_MV).unwrap();
        rig.board.power_on();
        rig.started();
        rig.unlock();
        last
    });
    assert!(
        operations >= HALF_WORDS + 2 * (ERASE - 1),
        "{operations} operations: one erase in front of the record and one after it"
    );
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_any_operation_of_the_start_that_makes_room_again() {
    let mut rig = rig();
    rig.unlock();
    save(&mut rig, set(1));
    rig.configure(FILTER, &set(2));
    // A record cut in two: the next start moves the record before it to the other page.
    rig.board.cut_in_flash_operation(HALF_WORDS / 2, 0.5);
    rig.write(0x0108, &[1]).unwrap();
    rig.board.run_for(Time::from_ms(60));
    assert!(!rig.board.powered());
    let content = store(&rig);
    for operation in 1.. {
        restore(&mut rig, &content);
        let fraction = FRACTIONS[operation as usize % FRACTIONS.len()];
        rig.board.cut_in_flash_operation(operation, fraction);
        rig.board.power_on();
        rig.board.run_for(Time::from_ms(300));
        let done = rig.board.powered();
        rig.board.power_off();
        let what = format!("operation {operation}, {fraction} of it");
        after_cut(&mut rig, &[set(1)], &what);
        if done {
            assert!(operation > HALF_WORDS + 2, "only {operation} operations");
            return;
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_any_instant_under_traffic() {
    let mut rng = Rng::with_seed(0x6D6F_6469_6F03);
    let mut rig = Rig::set_up(Module::Do4, &[(0x0101, 1152)]);
    rig.tolerant = true;
    let mut stored = [0u16; 4];
    let mut saves = 0;
    for round in 0..50 {
        // The settings that may be stored at the end of this round.
        let mut candidates = vec![stored];
        let cut = rig.board.now() + Time::from_us(rng.u64(1_000..150_000));
        rig.unlock();
        while rig.board.now() < cut {
            let settings = [0; 4].map(|_| rng.u16(0..2));
            let words: Vec<u8> = settings
                .iter()
                .flat_map(|word| word.to_be_bytes())
                .collect();
            let save = rng.bool();
            let requests: &[Vec<u8>] = &[
                [&[1, 15, 0, FIRST, 0, 4, 1], &[rng.u8(0..16)][..]].concat(),
                [&[1, 16, 1, 0xE0 + FIRST, 0, 4, 8], &words[..]].concat(),
                if save {
                    vec![1, 6, 1, 8, 0, 1]
                } else {
                    vec![1, 1, 0, FIRST, 0, 4]
                },
                vec![1, 3, 1, 0xE0, 0, 32],
            ];
            if save {
                candidates.push(settings);
                saves += 1;
            }
            for request in requests {
                let now = rig.board.now();
                let end = rig.board.line().send(now, &adu(request));
                rig.board.run_until(cut.min(end + Time::from_ms(4)));
                rig.board.line().take_received();
            }
        }
        rig.board.power_off();
        for channel in 1..=4 {
            assert_eq!(rig.board.channel(channel), Channel::Do { on: false });
        }
        rig.board.run_for(Time::from_us(rng.u64(1..50_000)));
        rig.board.power_on();
        rig.started();
        let start = rig.registers(0x01E0 + SLOT, 4).unwrap();
        let known = candidates.iter().find(|set| set[..] == start);
        stored =
            *known.unwrap_or_else(|| panic!("round {round}: {start:?}, not of {candidates:?}"));
        let on: Vec<bool> = stored.iter().map(|value| *value != 0).collect();
        assert_eq!(rig.bits(1, SLOT, 4), Ok(on), "round {round}: START");
        assert!(!rig.status(INVALID), "round {round}");
        assert!(!rig.board.locked_up());
    }
    assert!(saves > 40, "only {saves} saves");
}
