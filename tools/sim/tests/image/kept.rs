//! The kept region: a reset at any instruction of an update loses at most that update.

use sim::{Module, Time};

use crate::bench::{Bench, SLOT, adu, symbol};
use crate::kept_region::Contents;

const PULSES: u16 = 0x0300 + 2 * SLOT;
const FILTER: u16 = 0x0120 + SLOT;

/// Sends a request and runs until shortly before the unit executes it: the end of the frame, or of the echo.
fn send(bench: &mut Bench, pdu: &[u8], characters: u64) {
    let now = bench.board.now();
    let end = bench.board.line().send(now, &adu(&[&[1], pdu].concat()));
    let silence = bench.t35() + bench.characters(characters);
    bench.board.run_until(end + silence - Time::from_us(200));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn reset_at_any_instruction_of_an_update_loses_at_most_that_update() {
    let mut bench = Bench::set_up(Module::Di4, &[(FILTER, 0)]);
    bench.tolerant = true;
    // A unit that had lost the region would read the switch again, and not answer.
    bench.board.set_dip(2);
    let mut contents = Contents(Vec::new());
    for pulses in 0..2 {
        bench.board.set_energised(1, true).unwrap();
        contents.collect(&mut bench, 20_000, (pulses, 0), (pulses + 1, 0));
        bench.board.set_energised(1, false).unwrap();
        bench.board.run_for(Time::from_ms(3));
    }
    bench.configure(FILTER, &[1]);
    send(&mut bench, &[6, 1, 8, 0, 1], 8);
    let updates = contents.0.len();
    contents.collect(&mut bench, 200_000, (2, 0), (2, 0));
    assert!(contents.0.len() > updates, "the budget of saves");
    bench.started();

    // A hard fault in the scan, and the start after it.
    let scan = symbol("EXTI1") & !1;
    let limit = bench.board.now() + Time::from_ms(5);
    assert!(bench.board.run_until_pc(scan, limit));
    let was = bench.board.patch_code(scan, &[0, 0xDE]).unwrap();
    contents.collect(&mut bench, 20_000, (2, 0), (2, 1));
    assert_eq!(bench.board.resets(), 1);
    bench.board.patch_code(scan, &was).unwrap();
    contents.collect(&mut bench, 60_000, (2, 1), (2, 1));
    bench.started();

    send(&mut bench, &[16, 3, 32, 0, 2, 4, 0, 0, 0, 0], 0);
    contents.collect(&mut bench, 40_000, (2, 1), (0, 1));
    bench.started();
    let seen = contents.play(&mut bench, |bench| {
        bench.board.reset();
        bench.started();
        (bench.long(PULSES), bench.register(0x0261))
    });
    assert!(
        seen.ends_with(&[(1, 0), (2, 0), (2, 1), (0, 1)]),
        "{seen:?}"
    );
}
