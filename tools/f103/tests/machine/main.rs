//! The part with programs written by hand: time, stalls, faults, resets, power cuts.

mod asm;
mod core;
mod costs;
mod crystal;
mod debug;
mod flash;
mod large;
mod measure;
mod parts;
#[allow(dead_code, reason = "the tests of boards use the other registers")]
mod regs;
mod resets;
mod reuse;

use asm::Asm;
use f103::chip::Config;
use f103::{Chip, Image, Time};

/// Time from power-on to the first instruction: the reset delay of the part.
const START: Time = Time::from_us(2_500);

/// Returns a chip that runs `program`.
fn chip(program: Asm) -> Chip<()> {
    chip_with(&program.image(), Config::default())
}

fn chip_with(image: &Image, config: Config) -> Chip<()> {
    Chip::in_circuit(image, config, ()).expect("the program fits")
}

/// Starts the crystal with this value of RCC_CR, and 72 MHz from it, with two wait states and the prefetch buffer.
fn to_72_mhz(program: &mut Asm, cr: u32) {
    use regs::{FLASH_ACR, RCC_CFGR, RCC_CR};
    program.store(FLASH_ACR, 0x12);
    program.store(RCC_CR, cr);
    program.wait_set(RCC_CR, 1 << 17);
    program.store(RCC_CFGR, 0x001D_0400);
    program.store(RCC_CR, cr | 1 << 24);
    program.wait_set(RCC_CR, 1 << 25);
    program.store(RCC_CFGR, 0x001D_0402);
    program.wait_set(RCC_CFGR, 8);
}

/// Returns the `n`th word that a program has stored at [`regs::OUT`].
fn out(chip: &Chip<()>, n: u32) -> u32 {
    chip.word(regs::OUT + 4 * n).expect("in SRAM")
}

/// Returns the findings as text.
fn findings(chip: &Chip<()>) -> Vec<String> {
    chip.findings().iter().map(|f| f.what.to_string()).collect()
}
