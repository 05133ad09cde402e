//! What the pulse counters of digital inputs survive. What they count is tested on the host, in `modio-drivers` and
//! `firmware`.

use sim::{Module, Time};

use crate::bench::{Bench, MODULE, SLOT};

const PULSES: u16 = 0x0300 + 2 * SLOT;

fn pulse(bench: &mut Bench, channel: usize, high_us: u64, low_us: u64) {
    bench.board.set_energised(channel, true).unwrap();
    bench.board.run_for(Time::from_us(high_us));
    bench.board.set_energised(channel, false).unwrap();
    bench.board.run_for(Time::from_us(low_us));
}

fn counts(bench: &mut Bench) -> [u32; 4] {
    let words = bench.registers(PULSES, 8).unwrap();
    [0, 1, 2, 3].map(|n| u32::from(words[2 * n]) << 16 | u32::from(words[2 * n + 1]))
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn counters_survive_a_restart_but_neither_another_module_nor_a_power_cycle() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.tolerant = true;
    for channel in [1, 4, 4] {
        pulse(&mut bench, channel, 8_000, 8_000);
    }
    bench.restart();
    assert_eq!(counts(&mut bench), [1, 0, 0, 2]);
    pulse(&mut bench, 1, 8_000, 8_000);
    bench.board.reset();
    bench.started();
    assert_eq!(counts(&mut bench), [2, 0, 0, 2]);
    bench.power_cycle();
    assert_eq!(counts(&mut bench), [0; 4]);
    pulse(&mut bench, 1, 8_000, 8_000);
    for module in [Module::Do4, Module::Di4] {
        bench.configure(MODULE, &[module.code()]);
        bench.save();
        bench.restart();
        assert_eq!(counts(&mut bench), [0; 4]);
    }
}
