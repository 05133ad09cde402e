//! Saved settings survive a restart, unsaved settings do not, and a damaged store leads to the defaults.

use sim::{
    Module,
    line::{Format, Settings},
};

use crate::bench::{Bench, MODULE, PORT, SLOT, pages};

const FILTER: u16 = 0x0120 + SLOT;
const INVALID: u16 = 2;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn saved_settings_survive_and_unsaved_settings_do_not() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.configure(FILTER, &[50, 60, 70, 80]);
    bench.save();
    bench.write(FILTER, &[1, 2, 3, 4]).unwrap();
    bench.power_cycle();
    assert_eq!(bench.registers(FILTER, 4), Ok(vec![50, 60, 70, 80]));
    assert_eq!(bench.register(MODULE), 1);
    // After thirty saves and some restarts, pages have been filled and erased.
    for n in 0..30 {
        bench.configure(FILTER, &[100 + n]);
        bench.save();
        if n % 3 == 0 {
            bench.power_cycle();
        }
        assert_eq!(bench.register(FILTER), 100 + n);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn record_of_all_settings_survives() {
    // The largest record: every register differs from its default.
    let mut bench = Bench::set_up(Module::Ai2Ao2, &[(0x0101, 1152)]);
    bench.patience = sim::Time::from_ms(5);
    let blocks = [
        (0x0120, 7),
        (0x0160, 4000),
        (0x0180, 1),
        (0x01A0, 1),
        (0x01C0, 99),
        (0x01E0, 77),
    ];
    bench.unlock();
    for (first, value) in blocks {
        bench.write(first, &[value; 32]).unwrap();
    }
    bench.write(0x0104, &[600, 3, 30, 1]).unwrap();
    bench.write(0x0141, &[513, 11, 4, 2, 60]).unwrap();
    for _ in 0..3 {
        bench.save();
        bench.power_cycle();
        for (first, value) in blocks {
            assert_eq!(
                bench.registers(first, 32),
                Ok(vec![value; 32]),
                "{first:#x}"
            );
        }
        assert_eq!(
            bench.registers(0x0101, 7),
            Ok(vec![1152, 0, 0, 600, 3, 30, 1])
        );
        assert_eq!(bench.registers(0x0140, 6), Ok(vec![0, 513, 11, 4, 2, 60]));
        assert!(!bench.status(INVALID));
        bench.configure(0x0105, &[3]);
        // Change one value so that a new record is written: an unchanged configuration is not written again.
        bench.write(0x0141, &[513]).unwrap();
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn save_of_the_stored_configuration_programs_no_flash() {
    let mut bench = Bench::set_up(Module::Di4, &[]);
    bench.configure(FILTER, &[50]);
    bench.save();
    let operations = bench.board.flash_operations();
    for _ in 0..10 {
        bench.command(1);
        bench.board.run_for(sim::Time::from_ms(50));
    }
    bench.power_cycle();
    assert_eq!(bench.board.flash_operations(), operations);
    assert_eq!(bench.register(FILTER), 50);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn damaged_store_leads_to_defaults_and_a_status_bit_until_the_next_save() {
    let mut bench = Bench::set_up(Module::Di4, &[(0x0104, 77)]);
    bench.board.power_off();
    let [first, second] = pages();
    for byte in &mut bench.board.flash_mut().unwrap()[first.start..second.end] {
        *byte = byte.wrapping_mul(31).wrapping_add(7);
    }
    bench.board.power_on();
    for _ in 0..2 {
        bench.started();
        assert!(bench.status(INVALID));
        assert_eq!(bench.registers(0x0101, 4), Ok(vec![96, 0, 0, 0]));
        assert_eq!(bench.register(0x020F + PORT), 0);
        bench.board.cycle();
    }
    bench.started();
    bench.configure(MODULE, &[1]);
    bench.save();
    bench.power_cycle();
    assert!(!bench.status(INVALID));
    assert_eq!(bench.register(0x020F + PORT), 1);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn all_switches_on_selects_the_default_line_settings_with_any_stored_settings() {
    let mut bench = Bench::set_up(Module::Di4, &[(0x0101, 9216), (0x0102, 2)]);
    assert_eq!(bench.register(0x0101), 9216);
    bench.board.set_dip(255);
    bench.power_cycle();
    bench.settings(Settings::default());
    let reply = bench.ask(255, &[3, 1, 1, 0, 2]).expect("the unit answers");
    assert_eq!(reply, [3, 4, 0x24, 0, 0, 2], "the stored values are read");
    // Correct the stored values.
    bench.ask(255, &[6, 1, 0, 0x5A, 0x17]).unwrap();
    bench.ask(255, &[16, 1, 1, 0, 2, 4, 0, 192, 0, 1]).unwrap();
    bench.ask(255, &[6, 1, 8, 0, 1]).unwrap();
    bench.board.run_for(sim::Time::from_ms(100));
    bench.board.set_dip(1);
    bench.power_cycle();
    bench.settings(Settings {
        baud: 19_200,
        format: Format::E1,
    });
    bench.assert_answers(1);
}

/// A master that writes outputs all day must not wear out the flash.
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn writing_outputs_over_and_over_programs_no_flash() {
    let mut bench = Bench::set_up(Module::Do4, &[]);
    let operations = bench.board.flash_operations();
    for n in 0..500_u16 {
        bench.write_bit(SLOT + n % 4, n % 3 == 0).unwrap();
    }
    assert_eq!(bench.board.flash_operations(), operations);
    assert!(!bench.status(8), "no unsaved change");
}
