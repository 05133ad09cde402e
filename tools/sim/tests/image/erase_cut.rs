//! Power cuts in the erases of the store: in the one that follows a change of pages, while a master waits
//! for a reply, and in one within a save, to which only a master that never reads can drive it.

use sim::Time;

use crate::{
    bench::{Bench, adu},
    power_cut::{FILTER, FRACTIONS, HALF_WORDS, after_cut, bench, rooms, save, set},
};

/// Mark destroyed, erase, mark.
const ERASE: u64 = 3;
const ROOM: usize = HALF_WORDS as usize * 2;

/// Writes to all units, which answers nothing and so gives the unit no time to erase in.
fn broadcast(bench: &mut Bench, address: u16, values: &[u16]) {
    let [a, b] = address.to_be_bytes();
    let count = values.len() as u8;
    let mut pdu = vec![0, 16, a, b, 0, count, count * 2];
    pdu.extend(values.iter().flat_map(|value| value.to_be_bytes()));
    let now = bench.board.now();
    bench.board.line().send(now, &adu(&pdu));
    bench.board.run_for(Time::from_ms(15));
}

/// Saves by broadcasts alone; the lock is open.
fn save_unheard(bench: &mut Bench, values: [u16; 4]) {
    broadcast(bench, FILTER, &values);
    broadcast(bench, 0x0108, &[1]);
    bench.board.run_for(Time::from_ms(60));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_any_operation_of_the_erase_after_a_change_of_pages() {
    let mut bench = bench();
    let mut round = 0;
    for operation in 1..=ERASE + 1 {
        for fraction in FRACTIONS {
            bench.unlock();
            // The page in use is full.
            while rooms(&bench).into_iter().min() >= Some(ROOM) {
                round += 1;
                save(&mut bench, set(round));
            }
            round += 1;
            bench.configure(FILTER, &set(round));
            bench.write(0x0108, &[1]).unwrap();
            bench.board.run_for(Time::from_ms(60));
            let operations = bench.board.flash_operations();
            bench.board.cut_in_flash_operation(operation, fraction);
            let now = bench.board.now();
            bench.board.line().send(now, &adu(&[1, 1, 0, 0x10, 0, 4]));
            bench.board.run_for(Time::from_ms(60));
            if operation > ERASE {
                assert_eq!(bench.board.flash_operations() - operations, ERASE);
                assert!(
                    rooms(&bench).into_iter().max() >= Some(1022),
                    "it is erased"
                );
                return;
            }
            assert!(!bench.board.powered(), "operation {operation} was cut");
            let what = format!("operation {operation}, {fraction} of it");
            after_cut(&mut bench, [set(round); 2], &what);
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_any_operation_of_a_save_that_has_to_erase() {
    let mut bench = bench();
    let mut round = 0;
    let mut seen = [0, 0];
    for operation in 1..=HALF_WORDS + ERASE + 1 {
        for fraction in FRACTIONS {
            bench.unlock();
            while rooms(&bench).into_iter().max() >= Some(ROOM) {
                round += 1;
                save_unheard(&mut bench, set(round));
            }
            let sets = [set(round), set(round + 1)];
            round += 1;
            broadcast(&mut bench, FILTER, &sets[1]);
            bench.board.cut_in_flash_operation(operation, fraction);
            broadcast(&mut bench, 0x0108, &[1]);
            bench.board.run_for(Time::from_ms(60));
            if operation > HALF_WORDS + ERASE {
                assert!(bench.board.powered(), "the save is over");
                assert!(seen[0] > 0 && seen[1] > 0, "{seen:?}");
                return;
            }
            assert!(!bench.board.powered(), "operation {operation} was cut");
            let what = format!("operation {operation}, {fraction} of it");
            seen[after_cut(&mut bench, sets, &what)] += 1;
        }
    }
}
