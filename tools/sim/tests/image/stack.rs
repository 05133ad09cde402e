//! The two ends of the RAM: free stack, and the kept region. Every test demands at its end that a KiB of the stack is free.

use sim::{Module, Time};

use crate::rig::{Rig, symbol};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn free_stack_is_in_its_register() {
    let mut rig = Rig::set_up(Module::Ai2Ao2, &[]);
    rig.configure(0x0120, &[7; 30]);
    rig.save();
    // The unit checks a part of the stack at a time.
    rig.board.run_for(Time::from_secs(1));
    let free = rig.register(0x020B);
    assert_eq!(usize::from(free), rig.free_stack());
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn kept_region_is_the_last_512_bytes_of_ram() {
    let rig = Rig::set_up(Module::Di4, &[]);
    let end = 0x2000_0000 + rig.board.ram().len() as u32;
    assert_eq!(symbol("_kept"), end - 512);
}
