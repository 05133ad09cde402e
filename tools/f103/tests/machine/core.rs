//! The core on its bus: counts and times of instructions, faults, bit-banding, SysTick, interrupts.

use f103::Time;
use f103::finding::What;

use super::asm::{Asm, When};
use super::debug::counting;
use super::regs::*;
use super::{START, chip, findings, out, to_72_mhz};

#[test]
fn step_executes_the_given_number_of_instructions_at_their_costs() {
    let mut program = Asm::new();
    program.spin();
    let mut chip = chip(program);
    chip.step(1);
    assert_eq!(chip.instructions(), 1);
    chip.step(63);
    assert_eq!(chip.instructions(), 64);
    // A NOP of one cycle and a branch of three cycles, at 8 MHz without wait states.
    assert_eq!(chip.now(), START + Time::cycles(32 * 4, 8_000_000));
    chip.run_until(START + Time::from_ms(77));
    assert_eq!(chip.instructions(), 308_000);
}

#[test]
fn run_until_pc_stops_at_the_address_and_resumes_from_it() {
    let (address, program) = counting();
    let mut chip = chip(program);
    let limit = Time::from_ms(10);
    assert!(chip.run_until_pc(address | 1, limit));
    assert_eq!((chip.pc(), chip.instructions()), (address, 2));
    assert!(chip.run_until_pc(address | 1, limit));
    assert_eq!((chip.pc(), chip.instructions()), (address, 5));
    assert_eq!(chip.register(3), Some(1));
    assert!(!chip.run_until_pc(0x0800_2000, limit));
    assert_eq!(chip.now().as_ms(), 10);
}

#[test]
fn bit_banding_reaches_single_bits_of_peripherals_and_sram() {
    let mut program = Asm::new();
    program.store(OUT, 0xF0);
    program.store(0x2200_0000, 1);
    program.store(0x2200_0000 + 7 * 4, 0);
    program.store(bit_band(RCC_APB2ENR, 4), 1);
    program.store(GPIOC + 4, 0x4424_4444);
    program.store(bit_band(GPIOC + 0x0C, 13), 1);
    program.copy(RCC_APB2ENR, OUT + 4);
    program.copy(bit_band(GPIOC + 8, 13), OUT + 8);
    program.spin();
    let mut chip = chip(program);
    chip.step(200);
    assert_eq!(
        [out(&chip, 0), out(&chip, 1), out(&chip, 2)],
        [0x71, 0x10, 1]
    );
    assert!(chip.pin('C', 13));
    assert_eq!(findings(&chip), [""; 0]);
}

#[test]
fn access_to_a_block_without_clock_is_lost_and_reported_with_its_address() {
    let mut program = Asm::new();
    program.set(0, GPIOA);
    program.set(1, 0x33);
    let culprit = program.address();
    program.str(1, 0, 0);
    program.copy(GPIOA, OUT);
    program.store(RCC_APB2ENR, 1 << 2);
    program.copy(GPIOA, OUT + 4);
    program.spin();
    let mut chip = chip(program);
    chip.step(100);
    assert_eq!((out(&chip, 0), out(&chip, 1)), (0, 0x4444_4444));
    let first = chip.findings()[0];
    assert_eq!(first.pc, culprit);
    assert_eq!(
        first.what,
        What::Unclocked {
            address: GPIOA,
            write: true,
            block: "GPIOA"
        }
    );
    assert_eq!(chip.findings().len(), 2);
}

#[test]
fn accesses_that_are_not_modelled_or_not_allowed_are_reported() {
    let mut program = Asm::new();
    program.copy(0x4002_3000, OUT);
    program.copy(0x4000_0C00, OUT);
    program.store(RCC_APB2ENR, 1 << 2);
    program.set(0, GPIOA + 0x0C);
    program.set(1, 1);
    program.strh(1, 0, 0);
    program.copy(0xE000_2000, OUT);
    program.spin();
    let mut chip = chip(program);
    chip.step(100);
    let found = findings(&chip);
    assert_eq!(found.len(), 4, "{found:#?}");
    assert!(found[0].contains("CRC"), "{}", found[0]);
    assert!(found[1].contains("reserved"), "{}", found[1]);
    assert!(found[2].contains("Half"), "{}", found[2]);
    assert!(found[3].contains("debug block"), "{}", found[3]);
}

#[test]
fn access_to_an_address_without_memory_faults() {
    let mut program = Asm::new();
    program.copy(0x2000_5000, OUT);
    program.spin();
    program.handler(3);
    program.store(OUT + 4, 0xFA);
    program.spin();
    let mut chip = chip(program);
    chip.step(100);
    assert_eq!(out(&chip, 1), 0xFA);
    assert!(matches!(
        chip.findings()[0].what,
        What::NoSuchAddress {
            address: 0x2000_5000,
            write: false
        }
    ));
    assert!(!chip.locked_up());
}

#[test]
fn a_fault_in_the_fault_handler_locks_up_the_core_and_time_passes() {
    let mut program = Asm::new();
    program.raw(0xDE00);
    program.handler(3);
    program.raw(0xDE00);
    let mut chip = chip(program);
    chip.run_until(Time::from_ms(20));
    assert!(chip.locked_up());
    assert_eq!(chip.now(), Time::from_ms(20));
    assert_eq!(findings(&chip), ["the core locked up"]);
    let done = chip.instructions();
    chip.step(10);
    assert_eq!(chip.instructions(), done, "the core executes nothing more");
}

#[test]
fn bkpt_is_a_hard_fault_that_is_reported_with_its_kind_and_its_address() {
    for (code, what) in [(0xBEAB, "semihosting: BKPT 0xAB"), (0xBE00, "BKPT stops")] {
        for process_stack in [false, true] {
            let mut program = Asm::new();
            if process_stack {
                program.set(0, 0x2000_1000);
                // MSR PSP, r0; MOV r0, #2; MSR CONTROL, r0; ISB.
                for half in [0xF380, 0x8809, 0x2002, 0xF380, 0x8814, 0xF3BF, 0x8F6F] {
                    program.raw(half);
                }
            }
            let at = program.address();
            program.raw(code);
            program.spin();
            program.handler(3);
            program.store(OUT, 0xFA);
            program.spin();
            let mut chip = chip(program);
            chip.run_until(Time::from_ms(5));
            assert_eq!(out(&chip, 0), 0xFA);
            let findings = chip.findings();
            assert_eq!(findings.len(), 1, "{findings:?}");
            assert_eq!(findings[0].pc, at);
            let text = findings[0].what.to_string();
            assert!(text.contains(what) && text.contains("hard fault"), "{text}");
        }
    }
}

#[test]
fn deep_sleep_is_reported() {
    let mut program = Asm::new();
    program.store(0xE000_ED10, 4);
    program.wfi();
    program.spin();
    let mut chip = chip(program);
    chip.run_until(Time::from_ms(5));
    assert!(chip.asleep());
    assert!(findings(&chip)[0].contains("SLEEPDEEP"));
}

/// Returns a program whose SysTick toggles PC13 every 8000 cycles, either at 8 MHz or at 72 MHz from the PLL.
fn systick_program(fast: bool) -> Asm {
    let mut program = Asm::new();
    program.store(RCC_APB2ENR, 1 << 4);
    program.store(GPIOC + 4, 0x4424_4444);
    if fast {
        to_72_mhz(&mut program, 0x1_0083);
    }
    program.set(4, GPIOC);
    program.set(5, 1 << 13);
    program.store(SYST_RVR, 7_999);
    program.store(SYST_CVR, 0);
    program.store(SYST_CSR, 7);
    let top = program.here();
    program.wfi();
    program.branch(When::Always, top);
    program.handler(15);
    program.ldr(6, 4, 0x0C);
    program.eor(6, 5);
    program.str(6, 4, 0x0C);
    program.bx(14);
    program
}

#[test]
fn systick_counts_hclk_and_wakes_the_core_on_the_right_cycle() {
    for (fast, hz) in [(false, 8_000_000), (true, 72_000_000)] {
        let mut chip = chip(systick_program(fast));
        chip.watch_pin('C', 13);
        chip.run_until(Time::from_ms(40));
        let edges = chip.pin_edges('C', 13);
        assert!(edges.len() > 20, "{} edges at {hz}", edges.len());
        let (first, _) = edges[0];
        for (n, &(at, _)) in (0..).zip(edges) {
            let expected = first + Time::cycles(8_000 * n, hz);
            let off = at.max(expected) - at.min(expected);
            assert!(
                off <= Time::from_ps(1),
                "edge {n} at {hz} Hz is off by {off:?}"
            );
        }
        assert!(chip.asleep());
        assert_eq!(chip.hclk(), hz);
        assert_eq!(findings(&chip), [""; 0]);
    }
}

#[test]
fn dwt_counts_cycles_through_sleep() {
    let mut program = Asm::new();
    program.store(DEMCR, 1 << 24);
    program.store(DWT_CTRL, 1);
    program.store(SYST_RVR, 999_999);
    program.store(SYST_CVR, 0);
    program.copy(DWT_CYCCNT, OUT);
    program.store(SYST_CSR, 7);
    program.wfi();
    program.copy(DWT_CYCCNT, OUT + 4);
    program.spin();
    program.handler(15);
    program.bx(14);
    let mut chip = chip(program);
    chip.run_until(Time::from_ms(200));
    let cycles = out(&chip, 1) - out(&chip, 0);
    assert!((1_000_000..1_000_050).contains(&cycles), "{cycles}");
}

#[test]
fn a_program_too_fast_for_its_wait_states_is_reported() {
    let mut program = Asm::new();
    program.store(RCC_CFGR, 7 << 18 | 0b100 << 8);
    program.store(RCC_CR, 0x0100_0083);
    program.wait_set(RCC_CR, 1 << 25);
    program.store(RCC_CFGR, 7 << 18 | 0b100 << 8 | 2);
    program.spin();
    let mut chip = chip(program);
    chip.run_until(Time::from_ms(5));
    assert_eq!(chip.hclk(), 36_000_000);
    assert_eq!(
        findings(&chip),
        ["SYSCLK is too fast for the wait states of the flash"]
    );
}

#[test]
fn run_is_the_same_to_the_instruction_in_steps_of_any_length() {
    let program = || {
        let mut program = systick_program(true);
        // The handler also counts in SRAM, so a difference shows there.
        program.handler(16 + 28);
        program.bx(14);
        program.image()
    };
    let config = f103::chip::Config::default;
    let mut whole = super::chip_with(&program(), config());
    let mut sliced = super::chip_with(&program(), config());
    whole.watch_pin('C', 13);
    sliced.watch_pin('C', 13);
    whole.run_until(Time::from_ms(50));
    let mut slice = 1;
    while sliced.now() < Time::from_ms(50) {
        slice = slice * 7 % 1_000_003;
        let to = (sliced.now() + Time::from_ns(slice)).min(Time::from_ms(50));
        sliced.run_until(to);
    }
    assert_eq!(whole.instructions(), sliced.instructions());
    assert_eq!(whole.now(), sliced.now());
    assert_eq!(whole.pin_edges('C', 13), sliced.pin_edges('C', 13));
    assert_eq!(whole.ram(), sliced.ram());
    for register in 0..=16 {
        assert_eq!(whole.register(register), sliced.register(register));
    }
}
