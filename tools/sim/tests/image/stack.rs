//! Free stack after a long run.

use sim::{Module, Time};

use crate::bench::Bench;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn at_least_a_kibibyte_of_stack_is_free_after_all_kinds_of_work() {
    let mut bench = Bench::set_up(Module::Ai2Ao2, &[]);
    for address in (0x0100..0x0340).step_by(16) {
        let _ = bench.registers(address, 16);
    }
    bench.configure(0x0120, &[7; 30]);
    bench.save();
    bench.board.run_for(Time::from_ms(50));
    let free = bench.register(0x020B);
    assert!((1024..20 * 1024).contains(&free), "{free} bytes");
}
