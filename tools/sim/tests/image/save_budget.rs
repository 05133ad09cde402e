//! The budget of saves, which a restart does not fill again.

use register_map::configuration::SAVES;
use sim::{Module, Time};

use crate::bench::{Bench, SLOT};

const FILTER: u16 = 0x0120 + SLOT;
const COMMAND: u16 = 0x0108;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn save_after_twenty_saves_and_a_restart_is_refused_for_a_minute() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.tolerant = true;
    for n in 0..u16::from(SAVES) {
        bench.configure(FILTER, &[100 + n]);
        bench.save();
    }
    let operations = bench.board.flash_operations();
    bench.configure(FILTER, &[200]);
    assert_eq!(bench.write(COMMAND, &[1]), Err(6));
    bench.restart();
    assert_eq!(bench.register(FILTER), 119);
    // A save of the stored settings costs nothing.
    bench.unlock();
    bench.save();
    bench.configure(FILTER, &[200]);
    assert_eq!(bench.write(COMMAND, &[1]), Err(6));
    assert_eq!(bench.board.flash_operations(), operations);

    bench.board.run_for(Time::from_secs(61));
    bench.unlock();
    bench.save();
    bench.configure(FILTER, &[201]);
    assert_eq!(bench.write(COMMAND, &[1]), Err(6));
    bench.power_cycle();
    assert_eq!(bench.register(FILTER), 200);
    bench.configure(FILTER, &[201]);
    bench.save();
}
