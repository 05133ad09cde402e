//! What the pulse counters of digital inputs survive. What they count is tested on the host, in `modio-drivers` and
//! `firmware`.

use sim::{Module, Time};

use crate::rig::{MODULE, Rig, SLOT};

const PULSES: u16 = 0x0300 + 2 * SLOT;

fn pulse(rig: &mut Rig, channel: usize, high_us: u64, low_us: u64) {
    rig.board.set_energised(channel, true).unwrap();
    rig.board.run_for(Time::from_us(high_us));
    rig.board.set_energised(channel, false).unwrap();
    rig.board.run_for(Time::from_us(low_us));
}

fn counts(rig: &mut Rig) -> [u32; 4] {
    let words = rig.registers(PULSES, 8).unwrap();
    [0, 1, 2, 3].map(|n| u32::from(words[2 * n]) << 16 | u32::from(words[2 * n + 1]))
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn counters_survive_a_restart_but_neither_another_module_nor_a_power_cycle() {
    let mut rig = Rig::set_up(Module::Di4, &[]);
    rig.tolerant = true;
    for channel in [1, 4, 4] {
        pulse(&mut rig, channel, 8_000, 8_000);
    }
    rig.restart();
    assert_eq!(counts(&mut rig), [1, 0, 0, 2]);
    pulse(&mut rig, 1, 8_000, 8_000);
    rig.board.reset();
    rig.started();
    assert_eq!(counts(&mut rig), [2, 0, 0, 2]);
    rig.power_cycle();
    assert_eq!(counts(&mut rig), [0; 4]);
    pulse(&mut rig, 1, 8_000, 8_000);
    for module in [Module::Do4, Module::Di4] {
        rig.configure(MODULE, &[module.code()]);
        rig.save();
        rig.restart();
        assert_eq!(counts(&mut rig), [0; 4]);
    }
}
