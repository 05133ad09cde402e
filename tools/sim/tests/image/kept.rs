//! The kept region: a reset at any instruction of an update loses at most that update.

use sim::{Module, Time};

use crate::kept_region::Contents;
use crate::rig::{Rig, SLOT, adu, symbol};

const PULSES: u16 = 0x0300 + 2 * SLOT;
const FILTER: u16 = 0x0120 + SLOT;

/// Sends a request and runs until shortly before the unit executes it: the end of the frame, or of the echo.
fn send(rig: &mut Rig, pdu: &[u8], characters: u64) {
    let now = rig.board.now();
    let end = rig.board.line().send(now, &adu(&[&[1], pdu].concat()));
    let silence = rig.t35() + rig.characters(characters);
    rig.board.run_until(end + silence - Time::from_us(200));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn reset_at_any_instruction_of_an_update_loses_at_most_that_update() {
    let mut rig = Rig::set_up(Module::Di4, &[(FILTER, 0)]);
    rig.tolerant = true;
    // A unit that had lost the region would read the switch again, and not answer.
    rig.board.set_dip(2);
    let mut contents = Contents(Vec::new());
    for pulses in 0..2 {
        rig.board.set_energised(1, true).unwrap();
        contents.collect(&mut rig, 20_000, (pulses, 0), (pulses + 1, 0));
        rig.board.set_energised(1, false).unwrap();
        rig.board.run_for(Time::from_ms(3));
    }
    rig.configure(FILTER, &[1]);
    send(&mut rig, &[6, 1, 8, 0, 1], 8);
    let updates = contents.0.len();
    contents.collect(&mut rig, 200_000, (2, 0), (2, 0));
    assert!(contents.0.len() > updates, "the budget of saves");
    rig.started();

    // A hard fault in the scan, and the start after it.
    let scan = symbol("EXTI1") & !1;
    let limit = rig.board.now() + Time::from_ms(5);
    assert!(rig.board.run_until_pc(scan, limit));
    let was = rig.board.patch_code(scan, &[0, 0xDE]).unwrap();
    contents.collect(&mut rig, 20_000, (2, 0), (2, 1));
    assert_eq!(rig.board.resets(), 1);
    rig.board.patch_code(scan, &was).unwrap();
    contents.collect(&mut rig, 60_000, (2, 1), (2, 1));
    rig.started();

    send(&mut rig, &[16, 3, 32, 0, 2, 4, 0, 0, 0, 0], 0);
    contents.collect(&mut rig, 40_000, (2, 1), (0, 1));
    rig.started();
    let seen = contents.play(&mut rig, |rig| {
        rig.board.reset();
        rig.started();
        (rig.long(PULSES), rig.register(0x0261))
    });
    assert!(
        seen.ends_with(&[(1, 0), (2, 0), (2, 1), (0, 1)]),
        "{seen:?}"
    );
}
