//! The two ends of the RAM: free stack, and the kept region. Every test demands at its end that a KiB of the stack is free.

use sim::{Module, Time};

use crate::bench::{Bench, symbol};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn free_stack_is_in_its_register() {
    let mut bench = Bench::set_up(Module::Ai2Ao2, &[]);
    bench.configure(0x0120, &[7; 30]);
    bench.save();
    // The unit checks a part of the stack at a time.
    bench.board.run_for(Time::from_secs(1));
    let free = bench.register(0x020B);
    assert_eq!(usize::from(free), bench.free_stack());
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn kept_region_is_the_last_512_bytes_of_ram() {
    let bench = Bench::set_up(Module::Di4, &[]);
    let end = 0x2000_0000 + bench.board.ram().len() as u32;
    assert_eq!(symbol("_kept"), end - 512);
}
