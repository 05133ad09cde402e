//! Orders, blocks and state of an update, as requests.

use std::vec;

use boot_state::Record;
use register_map::update::{Slot, State as OfSlot};

use super::*;
use crate::update::TRIAL_S;

static LAYOUT: register_map::layout::Layout = MODIO_02.layout();

const PREPARE: u16 = 0xB001;
const CONFIRM: u16 = 0xB003;
const AS_255: u16 = 0xB007;
const CODES: [u16; 5] = [PREPARE, 0xB002, CONFIRM, 0xB004, AS_255];

/// Returns a unit with an image in this state in slot A, from which it runs.
fn rig(own: OfSlot, lora: u16) -> Rig {
    let rig = Rig::new(Module::Di4, &[(at::LORA, lora)]);
    let record = Record {
        preferred: Slot::A,
        states: [own, OfSlot::Empty],
        floor: 0,
        bits: 0,
    };
    let images = [[0; 10]; 2];
    let update = Update::new(1, &LAYOUT, Slot::A, Some(record), images, [0; 4], false);
    rig.device.update = Some(update);
    rig
}

/// Performs the next step of the update, which must be a change of the boot state.
fn write_state(rig: &mut Rig) {
    use crate::update::Job;
    let update = rig.device.update.as_mut().unwrap();
    let job = update.next().unwrap();
    assert!(matches!(job, Job::Write(_)));
    update.end(&job, Ok(()), [0; 10]);
}

#[test]
fn unit_without_loader_has_neither_the_orders_nor_the_files() {
    let mut rig = Rig::new(Module::Di4, &[]);
    for code in CODES {
        assert_eq!(rig.write(at::COMMAND, &[code]), Err(3), "{code:#x}");
        rig.unlock();
        assert_eq!(rig.write(at::COMMAND, &[code]), Err(3), "{code:#x}");
    }
    assert_eq!(rig.read(0x022A, 1), Ok(vec![0]));
}

#[test]
fn orders_need_the_lock_and_the_units_own_address() {
    let mut rig = rig(OfSlot::Confirmed, 0);
    assert_eq!(rig.read(0x022A, 1), Ok(vec![1]));
    assert_eq!(rig.write(at::COMMAND, &[PREPARE]), Err(6));
    rig.unlock();
    let own = Origin::default();
    let broadcast = Origin {
        broadcast: true,
        ..own
    };
    let by_serial = Origin {
        by_serial: true,
        ..own
    };
    for origin in [broadcast, by_serial] {
        rig.device.set_origin(origin);
        for code in CODES {
            assert_eq!(
                rig.write(at::COMMAND, &[code]),
                Err(6),
                "{code:#x} {origin:?}"
            );
        }
    }
    rig.device.set_origin(own);
    assert_eq!(rig.write(at::COMMAND, &[0xB002]), Err(6), "no blocks");
    assert_eq!(rig.write(at::COMMAND, &[0xB004]), Err(6), "no image");
    assert_eq!(rig.write(at::COMMAND, &[PREPARE]), Ok(()));
    assert_eq!(rig.write(at::COMMAND, &[PREPARE]), Err(6), "under way");
    assert_eq!(rig.write(at::COMMAND, &[AS_255]), Ok(()));
    assert_eq!(rig.device.restart, Some(Restart::As255));
}

#[test]
fn preparation_costs_a_save_of_the_budget() {
    let mut rig = rig(OfSlot::Confirmed, 0);
    rig.device.config.set_saves_left(1);
    rig.unlock();
    assert_eq!(rig.write(at::COMMAND, &[PREPARE]), Ok(()));
    write_state(&mut rig);
    assert_eq!(rig.device.config.saves_left(), 0);
    assert_eq!(rig.write(at::COMMAND, &[PREPARE]), Err(6));
    rig.device.tick(59_000);
    rig.unlock();
    rig.device.tick(1_000);
    assert_eq!(rig.write(at::COMMAND, &[PREPARE]), Ok(()));
}

#[test]
fn way_back_costs_a_save_of_the_budget() {
    let mut rig = rig(OfSlot::Confirmed, 0);
    let update = rig.device.update.as_mut().unwrap();
    let confirmed = [OfSlot::Confirmed; 2];
    *update = Update::new(
        1,
        &LAYOUT,
        Slot::A,
        Some(Record {
            preferred: Slot::A,
            states: confirmed,
            floor: 0,
            bits: 0,
        }),
        [[0; 10]; 2],
        [0; 4],
        false,
    );
    rig.device.config.set_saves_left(1);
    rig.unlock();
    assert_eq!(rig.write(at::COMMAND, &[0xB004]), Ok(()));
    assert_eq!(rig.device.config.saves_left(), 0);
}

/// Each line's order waits for its own reply, so both may have been checked before one is carried out.
#[test]
fn order_that_was_checked_before_an_order_of_the_other_line_is_not_taken() {
    let mut rig = rig(OfSlot::Confirmed, 1);
    let before = rig.device.config.saves_left();
    for line in [LineName::Rs485, LineName::Second] {
        rig.device.carry_out(Command::Prepare, line);
        assert_eq!(rig.device.config.saves_left(), before - 1);
    }
    write_state(&mut rig);
    assert_eq!(rig.device.update.as_ref().unwrap().record(6), 54);
    rig.unlock();
    // The boot state has changed, so COMMAND 2 does not replace that restart.
    rig.device.restart = Some(Restart::Update);
    assert_eq!(rig.write(at::COMMAND, &[2]), Ok(()));
    assert_eq!(rig.device.restart, Some(Restart::Update));
}

/// After 0xB007 a unit has no radio, so nobody could reach it over the air any more.
#[test]
fn preparation_over_the_air_needs_a_radio_with_settings_and_recovery_a_wire() {
    for (lora, answer) in [(1, Ok(())), (2, Err(6))] {
        let mut rig = rig(OfSlot::Confirmed, lora);
        rig.device.set_origin(Origin {
            line: LineName::Second,
            broadcast: false,
            by_serial: false,
        });
        let _ = rig.ask(&[6, 1, 0, 0x5A, 0x17]);
        assert_eq!(rig.write(at::COMMAND, &[PREPARE]), answer);
        assert_eq!(rig.write(at::COMMAND, &[AS_255]), Err(6));
        assert_eq!(rig.device.restart, None);
    }
}

#[test]
fn image_that_nobody_confirms_restarts_after_15_minutes() {
    for (own, restarts) in [(OfSlot::Trial(1), true), (OfSlot::Confirmed, false)] {
        let rig = rig(own, 0);
        rig.device.tick(TRIAL_S * 1000 - 1);
        assert_eq!(rig.device.restart, None);
        rig.device.tick(1);
        assert_eq!(rig.device.restart.is_some(), restarts);
    }
    let mut rig = rig(OfSlot::Trial(1), 0);
    rig.unlock();
    assert_eq!(rig.write(at::COMMAND, &[CONFIRM]), Ok(()));
    write_state(&mut rig);
    rig.device.tick(TRIAL_S * 1000);
    assert_eq!(rig.device.restart, None);
}

/// Function 15 with a first block of an image for slot B, and zeros.
fn block() -> Vec<u8> {
    let mut request = vec![0x15, 135, 6, 1, 0x80, 0, 0, 0, 64];
    request.resize(9 + 128, 0);
    request[9..15].copy_from_slice(b"MODI\x02\x01");
    request[21..25].copy_from_slice(&LAYOUT.slots[1].to_le_bytes());
    request[25..29].copy_from_slice(&512_u32.to_le_bytes());
    request
}

#[test]
fn block_keeps_the_lock_open_and_needs_none() {
    let mut rig = rig(OfSlot::Confirmed, 0);
    assert_eq!(rig.ask(&block()), [0x95, 6], "not prepared");
    rig.unlock();
    assert_eq!(rig.write(at::COMMAND, &[PREPARE]), Ok(()));
    write_state(&mut rig);
    while let Some(job) = rig.device.update.as_ref().unwrap().next() {
        let update = rig.device.update.as_mut().unwrap();
        update.end(&job, Ok(()), [0; 10]);
    }
    rig.device.tick(59_000);
    assert_eq!(rig.ask(&block()), block());
    rig.device.tick(59_000);
    assert_eq!(rig.read(at::KEY, 1), Ok(vec![1]));
    rig.device.tick(1_000);
    assert_eq!(rig.read(at::KEY, 1), Ok(vec![0]));
    assert_eq!(rig.ask(&block()), block());
    assert_eq!(rig.read(at::KEY, 1), Ok(vec![0]), "it stays closed");
    let reply = rig.ask(&[0x14, 7, 6, 0, 2, 0, 0, 0, 4]);
    assert_eq!(reply[4..], [0, 1, 0, 0, 0, 8, 0, 8]);
}
