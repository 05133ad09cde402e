//! Costs of code at the two corners of the core, against the classes of `f103::costs`, calculated by hand.

use f103::chip::Config;
use f103::{Chip, Corner, Time};

use super::asm::{Asm, When};
use super::regs::*;
use super::{chip_with, to_72_mhz};

/// Sets the part to 72 MHz, with the clocks of port A and TIM2.
fn fast() -> Asm {
    let mut program = Asm::new();
    to_72_mhz(&mut program, 1 << 16 | 1);
    program.store(RCC_APB2ENR, 1 << 2);
    program.store(RCC_APB1ENR, 1);
    program
}

/// Aligns the following code to a line of the flash.
fn align(program: &mut Asm) {
    while !program.address().is_multiple_of(8) {
        program.nop();
    }
}

/// Aligns the following code to a line, after a branch to a line of NOPs.
fn after_a_line(program: &mut Asm) {
    let over = program.forward(When::Always);
    align(program);
    program.land(over);
    (0..4).for_each(|_| program.nop());
}

/// Returns the cycles between two addresses of the program, at a corner.
fn cycles(program: Asm, [from, to]: [u32; 2], corner: Corner) -> u64 {
    let config = Config {
        corner,
        ..Config::default()
    };
    let mut chip = chip_with(&program.image(), config);
    let limit = Time::from_ms(50);
    let run_to = |chip: &mut Chip<()>, address| {
        assert!(chip.run_until_pc(address, limit), "to {address:#x}");
        chip.cycles()
    };
    let before = run_to(&mut chip, from);
    run_to(&mut chip, to) - before
}

/// Returns the cycles of `code`, which starts at the start of a line, at the nominal and at the slow corner.
fn costs(code: impl Fn(&mut Asm)) -> [u64; 2] {
    [Corner::Nominal, Corner::Slow].map(|corner| {
        let mut program = fast();
        program.set(4, GPIOA);
        program.set(5, TIM2);
        program.set(6, 0x2000_1000);
        after_a_line(&mut program);
        let from = program.address();
        code(&mut program);
        let to = program.address();
        program.spin();
        cycles(program, [from, to], corner)
    })
}

#[test]
fn code_in_sequence_waits_for_the_flash_only_at_the_slow_corner() {
    // Two lines of four NOPs each.
    let nops = costs(|program| (0..8).for_each(|_| program.nop()));
    assert_eq!(nops, [8, 8 + 2 * 2]);
    // Wide instructions use up a line in two cycles; the prefetch, which takes three, is too slow.
    let wide = costs(|program| (0..4).for_each(|_| program.set(0, 1)));
    assert_eq!(wide, [8 + 3, 8 + 4 * 2]);
}

#[test]
fn loads_and_stores_cost_more_without_pipelining_and_write_buffer() {
    let loads = costs(|program| (0..4).for_each(|n| program.ldr(n, 6, 0)));
    assert_eq!(loads, [2 + 3, 4 * 2 + 2]);
    let stores = costs(|program| (0..4).for_each(|n| program.str(n, 6, 0)));
    assert_eq!(stores, [4, 4 * 2 + 2]);
    // PUSH and POP of three registers.
    let multiple = costs(|program| {
        [0xB40E, 0xBC0E]
            .into_iter()
            .for_each(|code| program.raw(code))
    });
    assert_eq!(multiple, [2 * 4, 2 * 4 + 2]);
}

#[test]
fn an_access_to_an_apb_takes_cycles_of_its_clock() {
    // APB2 runs at HCLK, APB1 at half of HCLK.
    let apb2 = costs(|program| program.ldr(0, 4, 8));
    assert_eq!(apb2, [2 + 2, 2 + 2 + 3 + 1]);
    let apb1 = costs(|program| program.ldr(0, 5, 0x24));
    assert_eq!(apb1, [2 + 4, 2 + 2 + 6 + 1]);
    let store = costs(|program| program.str(0, 4, 0x10));
    assert_eq!(store, [2, 2 + 2 + 3]);
}

#[test]
fn literal_costs_the_wait_states_of_the_flash() {
    // LDR r0, [pc, #0] reads the following word.
    let literal = costs(|program| {
        program.raw(0x4800);
        program.nop();
    });
    assert_eq!(literal, [2 + 2 + 1, 2 + 2 + 2 + 3 + 1]);
    // A read of a table in flash through a register: the vector table.
    let table = costs(|program| {
        program.raw(0x2100); // movs r1, #0
        program.ldr(0, 1, 4);
    });
    assert_eq!(table, [1 + 2, 2 + 1 + 2 + 2 + 3]);
}

#[test]
fn literal_costs_the_wait_states_after_a_reset_too() {
    let mut program = fast();
    after_a_line(&mut program);
    let from = program.address();
    program.raw(0x4800);
    program.nop();
    let to = program.address();
    program.spin();
    let config = Config {
        corner: Corner::Slow,
        ..Config::default()
    };
    let mut chip = chip_with(&program.image(), config);
    for _ in 0..2 {
        let limit = chip.now() + Time::from_ms(50);
        assert!(chip.run_until_pc(from, limit));
        let before = chip.cycles();
        assert!(chip.run_until_pc(to, limit));
        assert_eq!(chip.cycles() - before, 2 + 2 + 2 + 3 + 1);
        chip.reset();
    }
}

#[test]
fn branches_refill_the_pipeline() {
    // CMP r0, r0; then a branch to the second next line.
    let branch = |when: When| {
        costs(move |program| {
            program.raw(0x4280);
            let over = program.forward(when);
            align(program);
            program.nop();
            align(program);
            program.land(over);
        })
    };
    assert_eq!(branch(When::Equal), [2 + 2 + 2, 2 + 2 + 3 + 2 + 3]);
    // Not taken: two NOPs up to the end of the line, then a line of four NOPs.
    assert_eq!(branch(When::NotEqual), [2 + 2 + 4, 2 + 2 + 3 + 2 + 2 + 4]);
}

#[test]
fn division_and_long_multiplication_cost_their_range() {
    // UDIV r0, r0, r1; UMULL r0, r1, r2, r3.
    let code = |halves: [u16; 2]| {
        costs(move |program| halves.into_iter().for_each(|half| program.raw(half)))
    };
    assert_eq!(code([0xFBB0, 0xF0F1]), [7, 2 + 12]);
    assert_eq!(code([0xFBA2, 0x0103]), [4, 2 + 5]);
}

#[test]
fn exception_costs_entry_return_and_tail_chain() {
    const SVCALL: usize = 11;
    const PENDSV: usize = 14;
    const ICSR: u32 = 0xE000_ED04;
    let total = |chained: bool| {
        [Corner::Nominal, Corner::Slow].map(|corner| {
            let mut program = fast();
            program.set(0, ICSR);
            program.set(1, 1 << 28);
            after_a_line(&mut program);
            let from = program.address();
            program.raw(0xDF00); // svc
            let to = program.address();
            program.spin();
            align(&mut program);
            program.handler(SVCALL);
            if chained {
                program.str(1, 0, 0);
            }
            program.bx(14);
            align(&mut program);
            program.handler(PENDSV);
            program.bx(14);
            cycles(program, [from, to], corner)
        })
    };
    // SVC with exception entry, and BX with the return.
    let [nominal, slow] = total(false);
    assert_eq!(nominal, 1 + (12 + 2) + 1 + (12 + 2));
    assert_eq!(slow, 2 + 1 + (16 + 2 * 2 + 3) + 1 + (12 + 2 + 3));
    // In addition the store that pends the other exception, its BX, and the change from one handler to the other.
    let [chained, slow_chained] = total(true);
    assert_eq!(chained - nominal, 1 + (6 + 2) + 1);
    assert_eq!(slow_chained - slow, 2 + (6 + 2 * 2 + 3) + 1);
}
