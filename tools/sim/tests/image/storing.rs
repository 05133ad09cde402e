//! A damaged store leads to the defaults, and only a save programs the flash.

use sim::Module;

use crate::bench::{Bench, SLOT, pages};

const INVALID: u16 = 2;

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn damaged_store_leads_to_defaults_and_a_status_bit_until_the_next_save() {
    let mut bench = Bench::set_up(Module::Di4, &[(0x0104, 77)]);
    bench.board.power_off();
    let [first, _] = pages();
    bench.board.flash_mut().unwrap()[first].fill(0x5A);
    bench.board.power_on();
    bench.started();
    assert!(bench.status(INVALID));
    assert_eq!(bench.registers(0x0101, 4), Ok(vec![96, 0, 0, 0]));
    bench.unlock();
    bench.save();
    bench.power_cycle();
    assert!(!bench.status(INVALID));
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
