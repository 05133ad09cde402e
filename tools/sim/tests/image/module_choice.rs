//! MODULE: a different module needs a setting and a restart, but no different firmware.

use register_map::configuration::{FILTER, RANGE, SAFE, SCALE, START};
use register_map::points::Kind;
use sim::{Module, Time};

use crate::LAYOUT;
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
fn every_module_can_replace_every_other_module() {
    // From each module to every later one and back, so that every pair is tried in both directions.
    let tour = Module::ALL.into_iter().enumerate().flat_map(|(n, one)| {
        let later = Module::ALL.into_iter().skip(n + 1);
        std::iter::once(one).chain(later.flat_map(move |other| [other, one]))
    });
    let mut last = Module::ALL[0];
    let mut bench = Bench::set_up(last, &[]);
    for module in tour.skip(1) {
        bench.configure(MODULE, &[module.code()]);
        assert_eq!(
            bench.register(0x020F + PORT),
            last.code(),
            "in force after the restart"
        );
        assert_points(&mut bench, last);
        bench.save();
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

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn only_ports_with_a_slot_accept_a_module() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.unlock();
    for port in 1..=8 {
        let address = 0x0110 + port - 1;
        let expected = if LAYOUT.board.has_slot(port) {
            Ok(())
        } else {
            Err(3)
        };
        for module in 1..=Module::LAST {
            assert_eq!(bench.write(address, &[module]), expected, "port {port}");
            assert_eq!(bench.write_single(6, address, module), expected);
        }
        assert_eq!(bench.write(address, &[Module::LAST + 1]), Err(3));
        assert_eq!(bench.write(address, &[0]), Ok(()), "port {port}");
    }
    let mut modules = [0; 8];
    modules[usize::from(PORT) - 1] = 2;
    modules[7] = 1;
    assert_eq!(
        bench.write(0x0110, &modules),
        Err(3),
        "one invalid value refuses all"
    );
    assert_eq!(bench.register(MODULE), 0);
    modules[7] = 0;
    assert_eq!(bench.write(0x0110, &modules), Ok(()));
    assert_eq!(bench.register(MODULE), 2);
    assert_eq!(bench.register(0x020F + PORT), 1, "in force until a restart");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn settings_made_for_one_module_switch_nothing_on_at_another() {
    let mut bench = Bench::set_up(Module::Ao4, &[]);
    for (first, value) in [
        (FILTER, 900),
        (RANGE, 1),
        (SCALE, 1),
        (SAFE, 4095),
        (START, 4095),
    ] {
        bench.configure(first + SLOT, &[value; 4]);
    }
    bench.configure(MODULE, &[Module::Do4.code()]);
    for (first, default) in [(FILTER, 5), (RANGE, 0), (SCALE, 0), (SAFE, 0), (START, 0)] {
        assert_eq!(
            bench.registers(first + SLOT, 4),
            Ok(vec![default; 4]),
            "{first:#x}"
        );
    }
    // New values must now fit the new module.
    assert_eq!(bench.write(START + SLOT, &[2]), Err(3));
    bench.write(START + SLOT, &[1, 0, 0, 1]).unwrap();
    bench.save();
    bench.board.power_off();
    bench.board.set_module(Module::Do4).unwrap();
    bench.board.power_on();
    bench.started();
    assert_eq!(bench.bits(1, SLOT, 4), Ok(vec![true, false, false, true]));
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn settings_for_the_next_module_do_not_disturb_the_one_in_force() {
    // A running 4DO, with a 4AO set for the next start and a SAFE value that no bit can have.
    let mut bench = Bench::set_up(Module::Do4, &[]);
    bench.write_bits(SLOT, &[true; 4]).unwrap();
    bench.configure(MODULE, &[Module::Ao4.code()]);
    bench.write(SAFE + SLOT, &[4095; 4]).unwrap();
    bench.write(0x0104, &[1]).unwrap();
    bench.board.run_for(Time::from_ms(200));
    assert_eq!(bench.bits(1, SLOT, 4), Ok(vec![false; 4]), "SAFE's default");
    assert_eq!(bench.write_bits(SLOT, &[true; 4]), Ok(()));
}
