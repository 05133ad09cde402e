//! Power cuts: at every flash operation of a save and of the start after it, and at any instant under traffic. After
//! the cut, the configuration is completely the old or completely the new one, and the device still works.

use fastrand::Rng;
use sim::{Channel, Module, Time, periph::flash::Torn};

use crate::bench::{
    Bench, FIRST, GOOD_MV, LOW_MV, PAGE_ADDRESSES, PAGE_SIZE, PORT, SLOT, adu, pages,
};

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
/// A save takes 2 ms. A save that has to erase takes 30 ms more, during which the unit does not serve the line.
const SAVE: Time = Time::from_ms(60);
/// Time after which a save that only programs half-words has ended. A save that also erases takes longer.
const PLAIN_SAVE: Time = Time::from_ms(6);
/// Number of starts after a cut. Unstable cells read differently at each start.
const STARTS: usize = 2;

fn bench() -> Bench {
    let mut bench = Bench::set_up(Module::Di4, &[(0x0101, 1152)]);
    bench.tolerant = true;
    bench
}

/// Returns four settings that no other round has.
fn set(round: u16) -> [u16; 4] {
    [0, 1, 2, 3].map(|n| 10 + (round * 4 + n) % 900)
}

/// Saves these settings. The lock must be open.
fn save(bench: &mut Bench, values: [u16; 4]) {
    bench.write(FILTER, &values).unwrap();
    for _ in 0..TRIES {
        let before = bench.board.flash_operations();
        bench.write(0x0108, &[1]).unwrap();
        bench.board.run_for(PLAIN_SAVE);
        if bench.board.flash_operations() - before != HALF_WORDS {
            bench.board.run_for(SAVE - PLAIN_SAVE);
        }
        if !bench.status(8) {
            return;
        }
    }
    panic!("{values:?} are not saved");
}

/// Returns the number of erased bytes at the end of each of the store's pages.
fn rooms(bench: &Bench) -> [usize; 2] {
    let flash = bench.board.flash();
    pages().map(|page| {
        let bytes = flash[page].iter().rev();
        bytes.take_while(|byte| **byte == 0xFF).count()
    })
}

/// Returns the index of the set that is stored after a cut. Asserts that the rest of the device is in order.
fn after_cut(bench: &mut Bench, sets: [[u16; 4]; 2], what: &str) -> usize {
    let mut first = None;
    for start in 0..STARTS {
        bench.board.power_on();
        bench.started();
        let values = bench.registers(FILTER, 4).unwrap();
        assert!(!bench.status(INVALID), "{what}: the store is not damaged");
        assert_eq!(bench.registers(0x0101, 2), Ok(vec![1152, 0]), "{what}");
        assert_eq!(bench.register(0x020F + PORT), 1, "{what}");
        assert_eq!(
            first.get_or_insert_with(|| values.clone()),
            &values,
            "{what}: start {start} finds another configuration"
        );
        if start + 1 < STARTS {
            bench.board.power_off();
            bench.board.run_for(Time::from_ms(10));
        }
    }
    let values = first.unwrap_or_default();
    let place = sets.iter().position(|set| set[..] == values);
    place.unwrap_or_else(|| panic!("{what}: {values:?} is neither of {sets:?}"))
}

/// Cuts the power in every operation of a save. `prepare` brings the store to the state before that save. Returns the
/// number of operations of the save.
fn every_cut_of_a_save(prepare: impl Fn(&mut Bench, &mut u16), what: &str) -> u64 {
    let mut bench = bench();
    let mut round = 0;
    let mut seen = [0, 0];
    for operation in 1.. {
        // Two of the four instants, in turns: neighbouring half-words together cover all of them.
        for fraction in FRACTIONS
            .into_iter()
            .skip(operation as usize % 2)
            .step_by(2)
        {
            round += 1;
            bench.unlock();
            save(&mut bench, set(round));
            prepare(&mut bench, &mut round);
            let sets = [set(round), set(round + 1)];
            round += 1;
            bench.configure(FILTER, &sets[1]);
            bench.board.cut_in_flash_operation(operation, fraction);
            bench.write(0x0108, &[1]).unwrap();
            // The save may have waited for the supply.
            bench.board.run_for(Time::from_ms(20));
            bench.board.set_supply_mv(GOOD_MV).unwrap();
            bench.board.run_for(Time::from_ms(100));
            if bench.board.powered() {
                assert!(seen[0] > 0 && seen[1] > 0, "{what}: {seen:?}");
                return operation - 1;
            }
            let what = format!("{what}, operation {operation}, {fraction} of it");
            seen[after_cut(&mut bench, sets, &what)] += 1;
        }
    }
    unreachable!()
}

/// Saves until the page in use has no room for another record. The other page is then spare.
fn fill(bench: &mut Bench, round: &mut u16) {
    // Both pages have records or a mark; the page with more bytes is in use. Large records come first, because only
    // twenty saves are possible together.
    while rooms(bench).iter().min() >= Some(&LARGE_RECORD) {
        *round += 1;
        bench.write(BETA, &[2000 + *round % 900; 32]).unwrap();
        save(bench, set(*round));
    }
    bench.write(BETA, &[3950; 32]).unwrap();
    while rooms(bench).iter().min() >= Some(&(HALF_WORDS as usize * 2)) {
        *round += 1;
        save(bench, set(*round));
    }
    assert!(
        rooms(bench).iter().max() >= Some(&(PAGE_SIZE - 24)),
        "{:?}",
        rooms(bench)
    );
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_any_operation_of_a_save_after_the_last_record() {
    let operations = every_cut_of_a_save(|_, _| {}, "after the last record");
    assert_eq!(operations, HALF_WORDS, "half-words of the record alone");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_any_operation_of_a_save_that_changes_pages() {
    let operations = every_cut_of_a_save(fill, "to the other page");
    assert_eq!(
        operations,
        HALF_WORDS + ERASE,
        "the other page is already erased; the save erases the old page"
    );
}

/// A save that is requested while the supply is too low, when neither page has room. The start could not erase the page
/// that is not in use, so the save has to erase it when the supply is back.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_any_operation_of_a_save_that_has_to_erase() {
    let prepare = |bench: &mut Bench, round: &mut u16| {
        fill(bench, round);
        bench.board.power_off();
        bench.board.set_supply_mv(LOW_MV).unwrap();
        let spare = rooms(bench)
            .iter()
            .position(|room| *room >= PAGE_SIZE - 24)
            .expect("a spare page");
        let old = [0; PAGE_SIZE];
        bench.board.patch_code(PAGE_ADDRESSES[spare], &old).unwrap();
        bench.board.power_on();
        bench.started();
        bench.unlock();
    };
    let operations = every_cut_of_a_save(prepare, "with an erase in front");
    assert!(
        operations >= HALF_WORDS + 2 * (ERASE - 1),
        "{operations} operations: one erase in front of the record and one after it"
    );
}

/// Cuts the power in every operation of the start that makes room again. `torn` is how cut operations read.
fn every_cut_of_the_start_that_makes_room_again(torn: Torn) {
    let mut bench = bench();
    bench.board.set_torn(torn);
    let mut round = 0;
    for operation in 1.. {
        for fraction in FRACTIONS {
            round += 2;
            bench.unlock();
            save(&mut bench, set(round));
            bench.configure(FILTER, &set(round + 1));
            // A record cut in two: the next start moves the record before it to the other page.
            bench.board.cut_in_flash_operation(HALF_WORDS / 2, 0.5);
            bench.write(0x0108, &[1]).unwrap();
            bench.board.run_for(Time::from_ms(60));
            assert!(!bench.board.powered());

            bench.board.cut_in_flash_operation(operation, fraction);
            bench.board.power_on();
            bench.board.run_for(Time::from_ms(300));
            let done = bench.board.powered();
            bench.board.power_off();
            let what = format!("{torn:?}, operation {operation}, {fraction} of it");
            let sets = [set(round); 2];
            after_cut(&mut bench, sets, &what);
            if done {
                let least = HALF_WORDS + 2;
                assert!(operation > least, "only {operation} operations");
                return;
            }
        }
    }
}

// One test for each kind, so that they run in parallel: they take longest.

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_any_operation_of_the_start_that_makes_room_with_unsteady_cells() {
    every_cut_of_the_start_that_makes_room_again(Torn::Mess);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_any_operation_of_the_start_that_makes_room_with_old_bits() {
    every_cut_of_the_start_that_makes_room_again(Torn::Before);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_any_operation_of_the_start_that_makes_room_with_new_bits() {
    every_cut_of_the_start_that_makes_room_again(Torn::After);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_any_operation_of_the_very_first_start() {
    let mut bench = Bench::with(sim::Config::default());
    bench.tolerant = true;
    for operation in 1.. {
        for fraction in FRACTIONS {
            bench.board.power_off();
            let [first, _] = PAGE_ADDRESSES;
            bench
                .board
                .patch_code(first, &[0xFF; 2 * PAGE_SIZE])
                .unwrap();
            bench.board.cut_in_flash_operation(operation, fraction);
            bench.board.power_on();
            bench.board.run_for(Time::from_ms(300));
            if bench.board.powered() {
                assert!(
                    operation > 8,
                    "a mark and a record are more than {operation}"
                );
                return;
            }
            bench.board.power_on();
            bench.started();
            assert!(
                !bench.status(INVALID),
                "an empty store is not invalid: operation {operation}"
            );
            assert_eq!(bench.register(0x0101), 96);
            // A save now must be kept.
            bench.unlock();
            save(&mut bench, set(1));
            bench.power_cycle();
            assert_eq!(bench.registers(FILTER, 4), Ok(set(1).to_vec()));
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_any_instant_under_traffic() {
    let mut rng = Rng::with_seed(0x6D6F_6469_6F03);
    let mut bench = Bench::set_up(Module::Do4, &[(0x0101, 1152)]);
    bench.tolerant = true;
    let mut stored = [0u16; 4];
    let mut saves = 0;
    for round in 0..150 {
        // The settings that may be stored at the end of this round.
        let mut candidates = vec![stored];
        let cut = bench.board.now() + Time::from_us(rng.u64(1_000..150_000));
        bench.unlock();
        while bench.board.now() < cut {
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
                let now = bench.board.now();
                let end = bench.board.line().send(now, &adu(request));
                bench.board.run_until(cut.min(end + Time::from_ms(4)));
                bench.board.line().take_received();
            }
        }
        bench.board.power_off();
        for channel in 1..=4 {
            assert_eq!(bench.board.channel(channel), Channel::Do { on: false });
        }
        bench.board.run_for(Time::from_us(rng.u64(1..50_000)));
        bench.board.power_on();
        bench.started();
        let start = bench.registers(0x01E0 + SLOT, 4).unwrap();
        let known = candidates.iter().find(|set| set[..] == start);
        stored =
            *known.unwrap_or_else(|| panic!("round {round}: {start:?}, not of {candidates:?}"));
        let on: Vec<bool> = stored.iter().map(|value| *value != 0).collect();
        assert_eq!(bench.bits(1, SLOT, 4), Ok(on), "round {round}: START");
        assert!(!bench.status(INVALID), "round {round}");
        assert!(!bench.board.locked_up());
    }
    assert!(saves > 100, "only {saves} saves");
}
