//! The points of the slot, through every function that accesses them.

use sim::{Module, Time};

use crate::rig::{FIRST, Rig, adu};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn four_inputs_return_the_pin_levels_through_both_functions() {
    let mut rig = Rig::new(Module::Di4, 1);
    for pattern in [0b0000u8, 0b0001, 0b1010, 0b0101, 0b1111, 0b1000, 0b0000] {
        for channel in 1..=4 {
            let energised = pattern >> (channel - 1) & 1 != 0;
            rig.board.set_energised(channel, energised).unwrap();
        }
        rig.board.run_for(Time::from_ms(8));
        for function in [1, 2] {
            let all = rig.ask(1, &[function, 0, FIRST, 0, 4]);
            assert_eq!(all.as_deref(), Some(&[function, 1, pattern][..]));
            let middle = rig.ask(1, &[function, 0, FIRST + 1, 0, 2]);
            assert_eq!(
                middle.as_deref(),
                Some(&[function, 1, pattern >> 1 & 3][..])
            );
        }
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_write_reaches_its_output_before_the_reply_is_out() {
    let mut rig = Rig::new(Module::Do4, 1);
    rig.board.watch_pin('A', 0);
    let now = rig.board.now();
    let end = rig.board.line().send(now, &adu(&[1, 5, 0, FIRST, 0xFF, 0]));
    rig.answer_after(end);
    let edges = rig.board.pin_edges('A', 0);
    assert_eq!(edges.len(), 1, "{edges:?}");
    let (at, level) = edges[0];
    assert!(level);
    let late = at - (end + rig.t35());
    assert!(late < Time::from_us(200), "{late:?} after t3.5");
}
