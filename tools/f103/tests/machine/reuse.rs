//! A chip whose core has run the code of another chip runs like one with a new core.

use f103::chip::Config;
use f103::{Chip, Corner, Finding, Image, Time};

use super::asm::Asm;
use super::chip_with;
use super::flash::{OFFSET, PAGE, erase, program_half, unlock, wait};
use super::regs::OUT;

const CODE: u32 = 0x2000_1000;
/// Number of chips that are made to find a used core, because other tests of this process may take it first.
const TRIES: usize = 1_000;

/// Calls the function at [`PAGE`] and a copy of it in SRAM.
fn call(program: &mut Asm, n: u16) {
    program.copy(PAGE, CODE);
    for (at, n) in [(PAGE, n), (CODE, n + 1)] {
        program.set(3, at | 1);
        program.blx(3);
        program.set(0, OUT);
        program.str(5, 0, 4 * n);
    }
}

/// A program that calls the function, erases it, programs one that returns 2, and calls that.
fn image(nops: u32) -> Image {
    let mut program = Asm::new();
    (0..nops).for_each(|_| program.nop());
    call(&mut program, 0);
    unlock(&mut program);
    erase(&mut program);
    wait(&mut program);
    // movs r5, #2; bx lr
    for (offset, half) in [(0, 0x2502), (2, 0x4770)] {
        program_half(&mut program, offset, half);
        wait(&mut program);
    }
    call(&mut program, 2);
    program.spin();
    program.image()
}

/// A chip whose function returns this.
fn chip(nops: u32, returns: u8, corner: Corner, new_core: bool) -> Chip<()> {
    let mut flash = vec![0xFF; 128 * 1024];
    flash[OFFSET..OFFSET + 4].copy_from_slice(&[returns, 0x25, 0x70, 0x47]);
    let config = Config {
        flash: Some(flash),
        corner,
        new_core,
        ..Config::default()
    };
    chip_with(&image(nops), config)
}

type State = (Time, u64, Vec<Option<u32>>, Vec<u8>, Vec<u8>, Vec<Finding>);

/// Runs a start, a reset in its middle, and a power cut in the middle of the erase. Returns the state at many instants.
fn run(mut chip: Chip<()>) -> Vec<State> {
    let mut states = Vec::new();
    let mut run_on = |chip: &mut Chip<()>| {
        for _ in 0..60 {
            chip.run_for(Time::from_us(1_003));
            states.push((
                chip.now(),
                chip.instructions(),
                (0..=22).map(|number| chip.register(number)).collect(),
                chip.ram().to_vec(),
                chip.flash().to_vec(),
                chip.findings().to_vec(),
            ));
        }
    };
    run_on(&mut chip);
    chip.reset();
    run_on(&mut chip);
    chip.cut_in_flash_operation(1, 0.5);
    chip.reset();
    run_on(&mut chip);
    chip.power_on();
    run_on(&mut chip);
    states
}

#[test]
fn run_is_the_same_on_a_new_core_and_on_one_that_another_chip_has_used() {
    let new = chip(0, 1, Corner::Nominal, true);
    assert!(!new.core_is_used());
    let expected = run(new);
    let returned = |n: usize| expected[59].3[4 * n];
    assert_eq!([0, 1, 2, 3].map(returned), [1, 1, 2, 2]);
    let mut compared = 0;
    for left in 0..TRIES {
        let mut other = chip(1 + left as u32 % 5, 7, Corner::Slow, false);
        other.run_for(Time::from_ms(3 + left as u64 % 50));
        drop(other);
        let used = chip(0, 1, Corner::Nominal, false);
        if used.core_is_used() {
            assert!(run(used) == expected, "after chip {left}");
            compared += 1;
        }
        if compared == 3 {
            return;
        }
    }
    panic!("no chip received a used core");
}
