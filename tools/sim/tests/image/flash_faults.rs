//! Flash operations on a part at its limits: a late BSY, a missing EOP, a supply voltage that is too low.

use sim::{Module, Time};

use crate::rig::{GOOD_MV, LOW_MV, Rig, SLOT, START, adu, config};

const FILTER: u16 = 0x0120 + SLOT;
const UNSAVED: u16 = 8;
const SAVE: [u16; 1] = [1];

fn stored_value_after_power_cycle(rig: &mut Rig) -> u16 {
    rig.power_cycle();
    rig.register(FILTER)
}

/// The simulator always lets BSY rise one cycle late, after the first read.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn bsy_that_rises_late_does_not_end_a_program_or_an_erase_early() {
    let mut rig = Rig::set_up(Module::Di4, &[]);
    for n in 0..60 {
        rig.configure(FILTER, &[100 + n]);
        rig.save();
        rig.power_cycle_for_saves(n);
    }
    assert_eq!(stored_value_after_power_cycle(&mut rig), 159);
    let log = rig.board.take_log();
    assert!(!log.contains("could not be written"), "{log}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn operation_that_ends_without_eop_fails_the_save_and_the_next_save_succeeds() {
    for operation in [1, 4] {
        let mut rig = Rig::set_up(Module::Di4, &[]);
        rig.configure(FILTER, &[50]);
        rig.board.end_without_eop(operation);
        rig.write(0x0108, &SAVE).unwrap();
        rig.board.run_for(Time::from_ms(100));
        assert!(rig.status(UNSAVED), "operation {operation}");
        let log = rig.board.take_log();
        assert!(log.contains("the flash could not be written"), "{log}");
        rig.save();
        assert_eq!(stored_value_after_power_cycle(&mut rig), 50);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn save_waits_for_the_supply() {
    let mut rig = Rig::set_up(Module::Di4, &[]);
    rig.configure(FILTER, &[50]);
    let operations = rig.board.flash_operations();
    rig.board.set_supply_mv(LOW_MV).unwrap();
    rig.write(0x0108, &SAVE).unwrap();
    rig.board.run_for(Time::from_secs(2));
    assert_eq!(rig.board.flash_operations(), operations);
    assert!(rig.status(UNSAVED));
    assert_eq!(
        rig.write(0x0108, &SAVE),
        Err(6),
        "the save is still waiting"
    );
    let log = rig.board.take_log();
    assert_eq!(log.matches("supply is too low").count(), 1, "{log}");
    rig.board.set_supply_mv(GOOD_MV).unwrap();
    rig.board.run_for(Time::from_ms(50));
    assert!(!rig.status(UNSAVED), "the save is complete");
    assert_eq!(stored_value_after_power_cycle(&mut rig), 50);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn save_pauses_when_the_supply_falls_between_two_operations() {
    let mut rig = Rig::set_up(Module::Di4, &[]);
    rig.tolerant = true;
    rig.configure(FILTER, &[50, 60, 70, 80]);
    let operations = rig.board.flash_operations();
    let now = rig.board.now();
    rig.board.line().send(now, &adu(&[1, 6, 1, 8, 0, 1]));
    while rig.board.flash_operations() < operations + 5 {
        rig.board.run_for(Time::from_us(10));
    }
    rig.board.set_supply_mv(LOW_MV).unwrap();
    rig.board.run_for(Time::from_ms(50));
    rig.board.line().take_received();
    // A restart waits for the save, so it waits for the supply, too.
    rig.write(0x0108, &[2]).unwrap();
    rig.board.run_for(Time::from_secs(1));
    let paused = rig.board.flash_operations();
    assert!(paused <= operations + 6, "{}", paused - operations);
    assert_eq!(rig.board.resets(), 0);
    rig.board.set_supply_mv(GOOD_MV).unwrap();
    rig.started();
    assert_eq!(rig.board.resets(), 1);
    assert_eq!(rig.registers(FILTER, 4), Ok(vec![50, 60, 70, 80]));
    assert!(!rig.status(2), "the store is not damaged");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn start_with_a_low_supply_serves_and_changes_no_flash() {
    let mut rig = Rig::cold(config(Module::Di4, &[]));
    rig.board.set_supply_mv(LOW_MV).unwrap();
    let operations = rig.board.flash_operations();
    rig.board.run_for(START);
    rig.assert_answers(1);
    assert_eq!(rig.board.flash_operations(), operations);
    rig.board.set_supply_mv(GOOD_MV).unwrap();
    rig.configure(FILTER, &[50]);
    rig.save();
    assert_eq!(stored_value_after_power_cycle(&mut rig), 50);
}
