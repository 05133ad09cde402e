//! Several modules on one board: the points that a master reads and writes, and the stored settings.

use sim::{Module, Time};

use crate::bench::{Bench, MODULE, corner};
use crate::fitted::{change, channels, codes, fitted, outputs};

/// Modules in force and module states, ports 1 to 8.
const IN_FORCE: u16 = 0x0210;
const STATE: u16 = 0x0218;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn four_different_modules_answer_side_by_side() {
    let plugged = [Module::Di4, Module::Do4, Module::Ai4, Module::Ao4];
    let mut bench = fitted(plugged, &[]);
    assert_eq!(bench.register(0x0205), 2, "BOARD");
    assert_eq!(
        bench.registers(IN_FORCE, 8),
        Ok(vec![1, 2, 4, 5, 0, 0, 0, 0])
    );
    assert_eq!(bench.registers(STATE, 8), Ok(vec![0, 0, 0, 0, 1, 1, 1, 1]));

    change(&mut bench, 1, |slot| slot.set_energised(3, true)).unwrap();
    change(&mut bench, 3, |slot| slot.set_millivolts(2, 1650)).unwrap();
    bench.write_bits(4, &[true, false, false, true]).unwrap();
    bench.write(0x0C, &[1, 20, 300, 4000]).unwrap();
    // The default low-pass of an analog input takes 16 samples.
    bench.board.run_for(Time::from_ms(300));
    assert_eq!(outputs(&bench, 2), [true, false, false, true]);
    assert_eq!(codes(&bench, 4), [1, 20, 300, 4000]);

    // Bits of two slots by one request, words of two slots by another.
    let bits = [false, false, true, false, true, false, false, true];
    for function in [1, 2] {
        assert_eq!(bench.bits(function, 0, 8), Ok(bits.to_vec()));
        assert_eq!(bench.bits(function, 2, 3), Ok(bits[2..5].to_vec()));
    }
    for function in [3, 4] {
        let words = bench.words(function, 8, 8).unwrap();
        let noise = corner().adc_noise();
        for (word, exact) in words[..4].iter().zip([0, 2048, 0, 0]) {
            assert!(word.abs_diff(exact) <= 2 + noise, "{words:?}");
        }
        assert_eq!(words[4..], [1, 20, 300, 4000]);
    }
    // A write that includes an input point changes nothing.
    assert_eq!(bench.write_bits(3, &[true; 5]), Err(2));
    assert_eq!(bench.write(0x0B, &[7; 5]), Err(2));
    bench.board.run_for(Time::from_ms(50));
    assert_eq!(outputs(&bench, 2), [true, false, false, true]);
    assert_eq!(codes(&bench, 4), [1, 20, 300, 4000]);
    bench.assert_sound();
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn empty_slots_beside_relays_and_an_analog_module_have_no_points() {
    let plugged = [Module::None, Module::Relay2, Module::Ai2Ao2, Module::None];
    let mut bench = fitted(plugged, &[]);
    assert_eq!(bench.registers(IN_FORCE, 4), Ok(vec![0, 3, 6, 0]));
    assert_eq!(bench.registers(STATE, 4), Ok(vec![1, 0, 0, 1]));
    change(&mut bench, 2, |slot| slot.set_manual(1, true)).unwrap();
    bench.write_bits(6, &[false, true]).unwrap();
    bench.write(0x0A, &[4095, 17]).unwrap();
    bench.board.run_for(Time::from_ms(50));
    assert_eq!(bench.bits(1, 4, 4), Ok(vec![true, false, false, true]));
    let relay = |energised, manual| sim::Channel::Relay { energised, manual };
    assert_eq!(
        channels(&bench, 2)[..2],
        [relay(false, true), relay(true, false)]
    );
    let output = |code| sim::Channel::Ao { code };
    assert_eq!(channels(&bench, 3)[2..], [output(4095), output(17)]);
    // Empty slots and ports without a slot have no points.
    for point in [0, 3, 0x0C, 0x0F, 0x10, 0x13, 0x1F] {
        assert_eq!(bench.bits(1, point, 1), Err(2), "{point:#x}");
        assert_eq!(bench.registers(point, 1), Err(2), "{point:#x}");
        assert_eq!(bench.write_bit(point, true), Err(2), "{point:#x}");
        assert_eq!(bench.write(point, &[0]), Err(2), "{point:#x}");
    }
}

/// Plugs these modules while the power is off.
fn plug(bench: &mut Bench, plugged: [Module; 4]) {
    bench.board.power_off();
    for (port, module) in (1..).zip(plugged) {
        bench.board.set_module_at(port, module).unwrap();
    }
    bench.board.power_on();
    bench.started();
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn saved_modules_are_in_force_after_the_restart() {
    let mut bench = fitted([Module::Di4; 4], &[]);
    let next = [Module::Do4, Module::Ai4, Module::Ao4, Module::Relay2];
    bench.configure(MODULE, &next.map(|module| module.code()));
    // START of an output in ports 1 and 3, SAFE of one in port 4.
    bench.write(0x01E0 + 2, &[1]).unwrap();
    bench.write(0x01E0 + 8, &[100, 200]).unwrap();
    bench.write(0x01C0 + 0x0E, &[1]).unwrap();
    assert_eq!(bench.registers(IN_FORCE, 4), Ok(vec![1; 4]));
    assert_eq!(bench.bits(2, 0, 16), Ok(vec![false; 16]));
    bench.save();
    assert!(
        bench.status(16),
        "the status reports a setting that waits for a restart"
    );
    plug(&mut bench, next);
    assert!(!bench.status(16 | 8 | 2));
    assert_eq!(bench.registers(IN_FORCE, 4), Ok(vec![2, 4, 5, 3]));
    assert_eq!(outputs(&bench, 1), [false, false, true, false]);
    assert_eq!(codes(&bench, 3), [100, 200, 0, 0]);
    assert_eq!(bench.register(0x01CE), 1);

    // Many saves go through both pages of the store.
    for n in 0..150 {
        bench.configure(0x0120, &[n]);
        bench.save();
        bench.power_cycle_for_saves(n);
    }
    bench.power_cycle();
    assert_eq!(bench.registers(IN_FORCE, 4), Ok(vec![2, 4, 5, 3]));
    assert_eq!(bench.register(0x0120), 149);
}
