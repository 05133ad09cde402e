//! MODULE: a different module needs a setting and a restart, but no different firmware.

use register_map::points::Kind;
use sim::Module;

use crate::bench::{Bench, MODULE, PORT, SLOT};

/// Checks the replies of a module's points to a read of bits and to a read of words.
fn assert_points(bench: &mut Bench, module: Module) {
    let all = |kinds: [Kind; 2]| module.points().iter().all(|kind| kinds.contains(kind));
    let bits = all([Kind::BitInput, Kind::BitOutput]);
    let words = all([Kind::WordInput, Kind::WordOutput]);
    assert_eq!(bench.bits(1, SLOT, 4).is_ok(), bits, "{module:?}");
    assert_eq!(bench.registers(SLOT, 4).is_ok(), words, "{module:?}");
    let mut in_force = [0; 8];
    in_force[usize::from(PORT) - 1] = module.code();
    assert_eq!(bench.registers(0x0210, 8), Ok(in_force.to_vec()));
    let mut state = [1; 8];
    state[usize::from(PORT) - 1] = u16::from(module == Module::None);
    assert_eq!(bench.registers(0x0218, 8), Ok(state.to_vec()), "{module:?}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn every_module_is_in_force_after_the_restart_that_follows_its_setting() {
    let mut last = Module::Di4;
    let mut bench = Bench::set_up(last, &[]);
    for module in Module::ALL.into_iter().filter(|m| *m != Module::Di4) {
        bench.configure(MODULE, &[module.code()]);
        bench.save();
        assert_points(&mut bench, last);
        assert!(
            bench.status(16),
            "the status reports a setting that waits for a restart"
        );
        bench.board.power_off();
        bench.board.set_module(module).unwrap();
        bench.board.power_on();
        bench.started();
        assert_points(&mut bench, module);
        assert!(!bench.status(16 | 8 | 2));
        last = module;
    }
}
