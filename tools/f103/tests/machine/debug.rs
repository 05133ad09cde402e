//! The chip under a debugger: breakpoints, steps, registers, memory.

use f103::{Error, Time};

use super::asm::{Asm, When};
use super::regs::*;
use super::{START, chip, findings, out};

/// Returns a program that counts in r3 without end, and before it the address of the addition.
pub fn counting() -> (u32, Asm) {
    let mut program = Asm::new();
    program.set(3, 0);
    let top = program.here();
    let address = program.address();
    program.add(3, 1);
    program.nop();
    program.branch(When::Always, top);
    (address, program)
}

#[test]
fn breakpoint_halts_a_debugged_run_every_time_and_no_other_run() {
    let (address, program) = counting();
    let mut chip = chip(program);
    let before = chip.flash().to_vec();
    let limit = Time::from_ms(10);
    chip.add_breakpoint(address | 1);
    for round in 0..3 {
        assert!(chip.run_debugged(limit));
        assert_eq!((chip.pc(), chip.register(3)), (address, Some(round)));
        assert!(
            chip.run_debugged(limit),
            "the core stays at the breakpoint until it is passed"
        );
        assert_eq!(chip.register(3), Some(round));
        chip.pass_breakpoint();
    }
    assert_eq!(chip.flash(), before, "the flash is unchanged");
    chip.run_until(Time::from_ms(3));
    assert!(
        chip.register(3) > Some(500),
        "a plain run ignores the breakpoint"
    );
    assert!(
        chip.run_until_pc(address + 2, limit),
        "a run to another address ignores the breakpoint"
    );
    chip.remove_breakpoint(address);
    assert!(!chip.run_debugged(limit));
    assert_eq!(chip.now().as_ms(), 10);
}

#[test]
fn breakpoint_remains_after_a_reset() {
    let (address, program) = counting();
    let mut chip = chip(program);
    chip.add_breakpoint(address);
    assert!(chip.run_debugged(Time::from_ms(10)));
    chip.reset();
    assert_eq!(chip.pc(), address - 8, "before the first instruction");
    assert!(chip.run_debugged(Time::from_ms(10)));
    assert_eq!(chip.pc(), address);
}

#[test]
fn step_is_one_instruction_and_enters_no_interrupt() {
    let mut program = Asm::new();
    program.store(NVIC_ISER, 1 << 28);
    program.store(NVIC_ISER + 0x100, 1 << 28); // ISPR
    let behind = program.address();
    program.nop();
    program.nop();
    program.raw(0xE7FE);
    let handler = program.address();
    program.handler(16 + 28);
    program.bx(14);
    let mut chip = chip(program);
    chip.step(9);
    chip.step_instruction();
    assert_eq!(chip.pc(), behind, "the request is pending now");
    chip.add_breakpoint(behind);
    for n in 1..=2 {
        let (now, done) = (chip.now(), chip.instructions());
        chip.step_instruction();
        assert_eq!(chip.pc(), behind + 2 * n);
        assert_eq!(chip.instructions(), done + 1);
        assert!(chip.now() - now < Time::from_us(1));
    }
    chip.step_instruction();
    assert_eq!(
        chip.pc(),
        behind + 4,
        "a branch to its own address is a step, too"
    );
    assert!(
        chip.run_until_pc(handler, Time::from_ms(10)),
        "the interrupt stays pending"
    );
}

#[test]
fn step_of_a_sleeping_core_waits_for_the_interrupt_that_wakes_it() {
    let mut program = Asm::new();
    program.store(SYST_RVR, 79_999);
    program.store(SYST_CVR, 0);
    program.store(SYST_CSR, 7);
    program.wfi();
    program.spin();
    let handler = program.address();
    program.handler(15);
    program.nop();
    program.bx(14);
    let mut chip = chip(program);
    chip.run_until(Time::from_ms(5));
    assert!(chip.asleep());
    chip.step_instruction();
    assert_eq!(chip.pc(), handler + 2);
    assert_eq!((chip.now() - START).as_ms(), 10);
    // A step of a core that nothing wakes ends after a second.
    let mut program = Asm::new();
    program.wfi();
    let mut chip = super::chip(program);
    chip.run_until(Time::from_ms(5));
    let now = chip.now();
    chip.step_instruction();
    assert!(chip.asleep());
    assert_eq!(chip.now(), now + Time::from_secs(1));
}

#[test]
fn registers_can_be_changed() {
    let (address, program) = counting();
    let mut chip = chip(program);
    chip.step(20);
    chip.set_register(3, 1_000).unwrap();
    chip.set_register(15, address).unwrap();
    chip.step_instruction();
    assert_eq!(chip.register(3), Some(1_001));
    assert_eq!(
        (chip.register(13), chip.register(17)),
        (Some(0x2000_5000), Some(0x2000_5000))
    );
    chip.set_register(13, 0x2000_4000).unwrap();
    assert_eq!(chip.register(17), Some(0x2000_4000), "the core uses MSP");
    assert_eq!(chip.register(23), None);
    assert!(matches!(chip.set_register(23, 0), Err(Error::Range(_))));
}

#[test]
fn memory_is_read_and_sram_written_without_side_effects() {
    let (_, program) = counting();
    let mut chip = chip(program);
    let mut word = [0; 4];
    for vectors in [0, 0x0800_0000] {
        assert_eq!(chip.read_memory(vectors, &mut word), 4);
        assert_eq!(word, 0x2000_5000_u32.to_le_bytes());
    }
    assert_eq!(chip.read_memory(0xE000_ED00, &mut word), 4);
    assert_eq!(word, 0x411F_C231_u32.to_le_bytes());
    for nothing in [0x0802_0000, 0x2000_5000, RCC_CR, 0xE001_0000, 0x0002_0000] {
        assert_eq!(chip.read_memory(nothing, &mut word), 0, "{nothing:#x}");
    }
    assert_eq!(
        chip.read_memory(0x0801_FFFE, &mut word),
        2,
        "the read stops at the end of the memory"
    );
    assert_eq!(chip.read_memory(0xFFFF_FFFE, &mut word), 0);
    chip.write_memory(OUT, &[1, 2, 3, 4]).unwrap();
    assert_eq!(out(&chip, 0), 0x0403_0201);
    for nothing in [0x0800_0000, 0x2000_4FFE, RCC_CR, 0] {
        assert!(chip.write_memory(nothing, &[0; 4]).is_err(), "{nothing:#x}");
    }
    assert_eq!(findings(&chip), [""; 0]);
}
