//! Flash operations on a part at its limits: a late BSY, a missing EOP, a supply voltage that is too low.

use sim::{Module, Time};

use crate::bench::{Bench, GOOD_MV, LOW_MV, SLOT, START, adu, config};

const FILTER: u16 = 0x0120 + SLOT;
const UNSAVED: u16 = 8;
const SAVE: [u16; 1] = [1];

fn stored_value_after_power_cycle(bench: &mut Bench) -> u16 {
    bench.power_cycle();
    bench.register(FILTER)
}

/// The simulator always lets BSY rise one cycle late, after the first read.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn bsy_that_rises_late_does_not_end_a_program_or_an_erase_early() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    for n in 0..60 {
        bench.configure(FILTER, &[100 + n]);
        bench.save();
        bench.power_cycle_for_saves(n);
    }
    assert_eq!(stored_value_after_power_cycle(&mut bench), 159);
    let log = bench.board.take_log();
    assert!(!log.contains("could not be written"), "{log}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn operation_that_ends_without_eop_fails_the_save_and_the_next_save_succeeds() {
    for operation in [1, 4] {
        let mut bench = Bench::set_up(Module::Di4, &[]);
        bench.configure(FILTER, &[50]);
        bench.board.end_without_eop(operation);
        bench.write(0x0108, &SAVE).unwrap();
        bench.board.run_for(Time::from_ms(100));
        assert!(bench.status(UNSAVED), "operation {operation}");
        let log = bench.board.take_log();
        assert!(log.contains("the flash could not be written"), "{log}");
        bench.save();
        assert_eq!(stored_value_after_power_cycle(&mut bench), 50);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn save_waits_for_the_supply() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.configure(FILTER, &[50]);
    let operations = bench.board.flash_operations();
    bench.board.set_supply_mv(LOW_MV).unwrap();
    bench.write(0x0108, &SAVE).unwrap();
    bench.board.run_for(Time::from_secs(2));
    assert_eq!(bench.board.flash_operations(), operations);
    assert!(bench.status(UNSAVED));
    assert_eq!(
        bench.write(0x0108, &SAVE),
        Err(6),
        "the save is still waiting"
    );
    let log = bench.board.take_log();
    assert_eq!(log.matches("supply is too low").count(), 1, "{log}");
    bench.board.set_supply_mv(GOOD_MV).unwrap();
    bench.board.run_for(Time::from_ms(50));
    assert!(!bench.status(UNSAVED), "the save is complete");
    assert_eq!(stored_value_after_power_cycle(&mut bench), 50);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn save_pauses_when_the_supply_falls_between_two_operations() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.tolerant = true;
    bench.configure(FILTER, &[50, 60, 70, 80]);
    let operations = bench.board.flash_operations();
    let now = bench.board.now();
    bench.board.line().send(now, &adu(&[1, 6, 1, 8, 0, 1]));
    while bench.board.flash_operations() < operations + 5 {
        bench.board.run_for(Time::from_us(10));
    }
    bench.board.set_supply_mv(LOW_MV).unwrap();
    bench.board.run_for(Time::from_ms(50));
    bench.board.line().take_received();
    // A restart waits for the save, so it waits for the supply, too.
    bench.write(0x0108, &[2]).unwrap();
    bench.board.run_for(Time::from_secs(1));
    let paused = bench.board.flash_operations();
    assert!(paused <= operations + 6, "{}", paused - operations);
    assert_eq!(bench.board.resets(), 0);
    bench.board.set_supply_mv(GOOD_MV).unwrap();
    bench.started();
    assert_eq!(bench.board.resets(), 1);
    assert_eq!(bench.registers(FILTER, 4), Ok(vec![50, 60, 70, 80]));
    assert!(!bench.status(2), "the store is not damaged");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn start_with_a_low_supply_serves_and_changes_no_flash() {
    let mut bench = Bench::cold(config(Module::Di4, &[]));
    bench.board.set_supply_mv(LOW_MV).unwrap();
    let operations = bench.board.flash_operations();
    bench.board.run_for(START);
    bench.assert_answers(1);
    assert_eq!(bench.board.flash_operations(), operations);
    bench.board.set_supply_mv(GOOD_MV).unwrap();
    bench.configure(FILTER, &[50]);
    bench.save();
    assert_eq!(stored_value_after_power_cycle(&mut bench), 50);
}
