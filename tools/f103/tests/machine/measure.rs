//! Measurements: the load of the core, and the waiting times of interrupts.

use f103::{Chip, CoreTime, Time, Wait};

use super::asm::{Asm, When};
use super::regs::*;
use super::{START, chip, chip_with};

const NVIC_ISPR: u32 = 0xE000_E200;
const ICSR: u32 = 0xE000_ED04;
const TIM2_IRQ: usize = 16 + 28;
const PENDSV: usize = 14;
const SYSTICK: usize = 15;

/// Returns the time of `n` cycles of the HSI, from which the programs run without wait states.
fn cycles(n: u64) -> Time {
    Time::cycles(n, 8_000_000)
}

/// Returns the cycles of [`delay`]: two to set the count; in each round one for the subtraction, one for the NOP and
/// three for the branch; one for the last branch, which is not taken.
const fn delay_cycles(n: u64) -> u64 {
    2 + 5 * n - 2
}

/// Cycles of an exception's entry.
const ENTRY: u64 = 12;

/// Asserts that two times are equal except for rounding.
fn assert_close(a: Time, b: Time) {
    let off = a.max(b) - a.min(b);
    assert!(off <= Time::from_ns(1), "{a} is not {b}");
}

/// Disables or enables interrupts with PRIMASK.
fn mask(program: &mut Asm, on: bool) {
    program.raw(if on { 0xB672 } else { 0xB662 });
}

/// A delay of `3 n` instructions and one, which uses r7.
fn delay(program: &mut Asm, n: u32) {
    program.set(7, n);
    let top = program.here();
    program.raw(0x3F01); // subs r7, #1
    program.nop();
    program.branch(When::NotEqual, top);
}

/// A program in which TIM2 interrupts every millisecond. Returns the address of the instruction that starts TIM2. The
/// handler takes `3 rounds + 7` instructions.
fn ticking(program: &mut Asm) -> u32 {
    program.store(RCC_APB1ENR, 1);
    program.store(TIM2 + 0x28, 7);
    program.store(TIM2 + 0x2C, 999);
    program.store(TIM2 + 0x14, 1);
    program.store(TIM2 + 0x10, 0);
    program.store(TIM2 + 0x0C, 1);
    program.store(NVIC_ISER, 1 << 28);
    program.set(3, 0);
    program.set(4, TIM2);
    program.set(5, 1);
    program.str(5, 4, 0);
    program.address()
}

fn tick_handler(program: &mut Asm, rounds: u32) {
    program.handler(TIM2_IRQ);
    program.str(3, 4, 0x10);
    delay(program, rounds);
    program.bx(14);
}

#[test]
fn load_is_the_time_of_the_executed_instructions() {
    let mut program = Asm::new();
    ticking(&mut program);
    let top = program.here();
    program.wfi();
    program.branch(When::Always, top);
    tick_handler(&mut program, 50);
    let mut chip = chip(program);
    chip.run_until(Time::from_ms(20));
    let (before, done, slept) = (chip.core_time(), chip.instructions(), chip.cycles());
    assert_eq!(before.off, START);
    chip.run_for(Time::from_ms(100));
    let spent = chip.core_time().since(before);
    let done = chip.instructions() - done;
    // Two instructions of the loop, and those of the handler.
    assert_eq!(done, 100 * (2 + 1 + 2 + 150 + 1));
    // WFI and the branch back; exception entry, the store to APB1, the delay, the return.
    let each = 1 + 3 + ENTRY + 2 + delay_cycles(50) + 1 + 12;
    assert_close(spent.running, cycles(100 * each));
    assert_close(spent.asleep, Time::from_ms(100) - spent.running);
    assert_eq!((spent.stalled, spent.off), (Time::ZERO, Time::ZERO));
    assert!((spent.load() - 0.0351).abs() < 0.0001, "{}", spent.load());
    let slept_through = chip.cycles() - slept;
    assert!(slept_through.abs_diff(800_000) <= 1, "{slept_through}");
}

#[test]
fn endless_loop_is_not_sleep_and_chip_without_power_is_off() {
    let mut program = Asm::new();
    program.raw(0xE7FE);
    let mut chip = chip(program);
    chip.run_until(Time::from_ms(10));
    let running = Time::from_ms(10) - START;
    let expected = CoreTime {
        running,
        off: START,
        ..CoreTime::default()
    };
    assert_eq!(chip.core_time(), expected);
    chip.power_off();
    chip.run_for(Time::from_ms(5));
    assert_eq!(chip.core_time().off, START + Time::from_ms(5));
    assert_eq!(chip.core_time().running, running);
}

#[test]
fn a_flash_operation_stalls_the_core() {
    let mut program = Asm::new();
    program.store(FLASH_KEYR, 0x4567_0123);
    program.store(FLASH_KEYR, 0xCDEF_89AB);
    program.store(FLASH_CR, 1 << 1);
    program.store(FLASH_AR, 0x0800_4000);
    program.store(FLASH_CR, 1 << 1 | 1 << 6);
    // The instructions that the core may have fetched in advance run before the stall.
    (0..8).for_each(|_| program.nop());
    program.wfi();
    let mut chip = chip(program);
    chip.run_until(Time::from_ms(100));
    let spent = chip.core_time();
    assert_close(spent.stalled, Time::from_ms(30) - cycles(8));
    assert!(spent.asleep > Time::from_ms(67));
    assert!(spent.running < Time::from_us(10));
}

/// Returns the waiting time of the interrupt, from two addresses of the program (where it is pended, and its handler),
/// and the simulator's measurement.
fn waited(mut chip: Chip<()>, number: usize, pended: u32, handler: u32) -> (Time, Wait) {
    chip.measure_waits(true);
    let limit = Time::from_secs(1);
    assert!(chip.run_until_pc(pended, limit));
    let from = chip.now();
    assert!(chip.run_until_pc(handler, limit));
    (chip.now() - from, chip.wait(number))
}

#[test]
fn a_masked_interrupt_waits_from_its_request_to_its_handler() {
    let mut program = Asm::new();
    mask(&mut program, true);
    let started = ticking(&mut program);
    delay(&mut program, 5_000);
    mask(&mut program, false);
    program.spin();
    let handler = program.address();
    tick_handler(&mut program, 1);
    let (between, wait) = waited(chip(program), TIM2_IRQ, started, handler);
    assert_eq!(wait.entries, 1);
    // The timer requests the interrupt a millisecond after its start; the core enters it at the end of an instruction.
    let expected = between - Time::from_ms(1) - cycles(ENTRY);
    let off = wait.longest.max(expected) - wait.longest.min(expected);
    assert!(off < cycles(4), "{} is not {expected}", wait.longest);
    assert!(wait.at > Time::from_ms(4));
}

#[test]
fn wait_of_a_pended_interrupt_begins_with_the_instruction_that_pends_it() {
    for (number, register, bit) in [
        (TIM2_IRQ, NVIC_ISPR, 28),
        (PENDSV, ICSR, 28),
        (SYSTICK, ICSR, 26),
    ] {
        let mut program = Asm::new();
        program.store(NVIC_ISER, 1 << 28);
        mask(&mut program, true);
        program.store(register, 1 << bit);
        let pended = program.address();
        delay(&mut program, 700);
        mask(&mut program, false);
        program.spin();
        let handler = program.address();
        program.handler(number);
        program.bx(14);
        let (between, wait) = waited(chip(program), number, pended, handler);
        let waited = between - cycles(ENTRY);
        assert_eq!((wait.entries, wait.longest), (1, waited), "{number}");
        assert_close(waited, cycles(delay_cycles(700) + 1));
    }
}

#[test]
fn wait_of_systick_begins_with_its_event() {
    let mut program = Asm::new();
    mask(&mut program, true);
    program.store(SYST_RVR, 7_999);
    program.store(SYST_CVR, 0);
    program.store(SYST_CSR, 7);
    let started = program.address();
    delay(&mut program, 3_000);
    mask(&mut program, false);
    program.spin();
    let handler = program.address();
    program.handler(SYSTICK);
    program.bx(14);
    let (between, wait) = waited(chip(program), SYSTICK, started, handler);
    let expected = between - Time::from_ms(1) - cycles(ENTRY);
    let off = wait.longest.max(expected) - wait.longest.min(expected);
    assert!(off < cycles(4), "{} is not {expected}", wait.longest);
}

#[test]
fn wait_is_not_counted_before_enabling_or_after_clearing_an_interrupt() {
    let mut program = Asm::new();
    program.store(NVIC_ISPR, 1 << 28);
    delay(&mut program, 1_000);
    program.store(NVIC_ISER, 1 << 28);
    mask(&mut program, true);
    program.store(NVIC_ISPR, 1 << 28);
    delay(&mut program, 1_000);
    program.store(NVIC_ISPR + 0x80, 1 << 28); // ICPR
    mask(&mut program, false);
    program.store(NVIC_ISPR, 1 << 28);
    program.spin();
    program.handler(TIM2_IRQ);
    program.bx(14);
    let mut chip = chip(program);
    chip.measure_waits(true);
    chip.run_until(Time::from_ms(20));
    let wait = chip.wait(TIM2_IRQ);
    assert_eq!((wait.entries, wait.longest), (2, Time::ZERO));
    assert_eq!(chip.wait(PENDSV), Wait::default());
    assert_eq!(chip.wait(1_000), Wait::default());
    chip.measure_waits(true);
    assert_eq!(chip.wait(TIM2_IRQ), Wait::default(), "anew");
}

#[test]
fn measuring_does_not_change_the_run() {
    let program = || {
        let mut program = Asm::new();
        ticking(&mut program);
        program.store(NVIC_ISER, 1 << 28 | 1 << 6);
        program.store(SYST_RVR, 6_543);
        program.store(SYST_CSR, 7);
        let top = program.here();
        mask(&mut program, true);
        delay(&mut program, 123);
        mask(&mut program, false);
        program.store(NVIC_ISPR, 1 << 6);
        program.copy(TIM2 + 0x24, OUT);
        program.wfi();
        program.branch(When::Always, top);
        tick_handler(&mut program, 40);
        program.handler(SYSTICK);
        program.copy(TIM2 + 0x24, OUT + 4);
        program.bx(14);
        program.handler(16 + 6);
        program.bx(14);
        program.image()
    };
    let mut plain = chip_with(&program(), f103::chip::Config::default());
    let mut measured = chip_with(&program(), f103::chip::Config::default());
    measured.measure_waits(true);
    for chip in [&mut plain, &mut measured] {
        chip.run_until(Time::from_ms(30));
        chip.reset();
        chip.run_until(Time::from_ms(60));
    }
    assert!(measured.wait(TIM2_IRQ).entries > 50);
    assert!(measured.wait(TIM2_IRQ).longest > Time::from_us(1));
    assert!(measured.wait(SYSTICK).entries > 60);
    assert_eq!(plain.wait(SYSTICK), Wait::default());
    assert_eq!(plain.instructions(), measured.instructions());
    assert_eq!(plain.now(), measured.now());
    assert_eq!(plain.ram(), measured.ram());
    assert_eq!(plain.core_time(), measured.core_time());
}
