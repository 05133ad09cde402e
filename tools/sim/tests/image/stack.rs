//! The two ends of the RAM: free stack after a long run, and the kept region.

use sim::{Module, Time};

use crate::bench::Bench;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_least_a_kibibyte_of_stack_is_free_after_all_kinds_of_work() {
    let mut bench = Bench::set_up(Module::Ai2Ao2, &[]);
    for address in (0x0100..0x0500).step_by(16) {
        let _ = bench.registers(address, 16);
    }
    bench.configure(0x0120, &[7; 30]);
    bench.save();
    bench.board.run_for(Time::from_ms(50));
    let free = bench.register(0x020B);
    assert!((1024..20 * 1024).contains(&free), "{free} bytes");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn kept_region_is_the_last_512_bytes_of_ram() {
    let bench = Bench::set_up(Module::Di4, &[]);
    let end = 0x2000_0000 + bench.board.ram().len() as u32;
    assert_eq!(bench.board.symbol("_kept"), Some(end - 512));
}
