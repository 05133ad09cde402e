//! A program that uses the LoRa module of both boards: it sends each byte from the air back, plus one.

use super::asm::{Asm, When};
use super::regs::*;

/// Sets USART3 to 9600 8N1 from 8 MHz, with its pins, and AUX of both boards to an input with a pull-up.
pub fn set_up() -> Asm {
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 0b1_1101);
    program.store(RCC_APB1ENR, 1 << 18);
    // PB5 with a pull-up, PB10 alternate output, PB11 with a pull-up. PB0 and PB1 stay inputs.
    program.store(GPIOB + 0x0C, 1 << 5 | 1 << 11);
    program.store(GPIOB, 0x4484_4444);
    program.store(GPIOB + 4, 0x4444_8B44);
    // PC12 with a pull-up.
    program.store(GPIOC + 0x0C, 1 << 12);
    program.store(GPIOC + 4, 0x4448_4444);
    program.store(USART3 + 8, 833);
    program.store(USART3 + 0x0C, 0x200C);
    program
}

/// Makes M0 and M1 of both boards outputs, low.
pub fn select_normal_mode(program: &mut Asm) {
    program.store(GPIOB, 0x4484_4422);
    program.store(GPIOC + 4, 0x4448_2244);
}

/// Sends each received byte back, plus one.
pub fn echo(program: &mut Asm) {
    program.set(4, USART3);
    let top = program.here();
    program.wait_set(USART3, 1 << 5);
    program.ldr(3, 4, 4);
    program.add(3, 1);
    program.str(3, 4, 4);
    program.branch(When::Always, top);
}
