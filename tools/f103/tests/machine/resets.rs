//! Resets and start-up: flags, the watchdog, the crystal, the power supply.

use f103::Time;

use super::asm::{Asm, When};
use super::regs::*;
use super::{START, chip, findings, out};

const POWER_ON: u32 = 0x0C00_0000;
const PIN: u32 = 0x0400_0000;
const SOFTWARE: u32 = 0x1400_0000;
const WATCHDOG: u32 = 0x2400_0000;

/// A program that stores RCC_CSR and clears its flags; the caller adds the rest.
fn report_cause() -> Asm {
    let mut program = Asm::new();
    program.copy(RCC_CSR, OUT);
    program.store(RCC_CSR, 1 << 24);
    program
}

/// Counts to 2000, which takes about a millisecond.
fn wait_a_moment(program: &mut Asm) {
    program.set(7, 0);
    let top = program.here();
    program.add(7, 1);
    program.set(6, 2_000);
    program.raw(0x42B7); // cmp r7, r6
    program.branch(When::NotEqual, top);
}

#[test]
fn watchdog_resets_after_its_time_out_and_sets_its_flag() {
    let mut program = report_cause();
    // Starting the watchdog enables the LSI, which transfers the prescaler.
    program.store(IWDG_KR, 0xCCCC);
    program.store(IWDG_KR, 0x5555);
    program.store(IWDG_PR, 1);
    wait_a_moment(&mut program);
    program.store(IWDG_KR, 0xAAAA);
    program.spin();
    let mut chip = chip(program);
    chip.run_until(Time::from_ms(100));
    assert_eq!(out(&chip, 0) & 0xFF00_0000, POWER_ON);
    assert_eq!(chip.resets(), 0);
    // 4096 x 8 / 40 kHz.
    chip.run_until(START + Time::from_us(819_200 - 100));
    assert_eq!(chip.resets(), 0);
    chip.run_until(START + Time::from_us(819_200 + 5_000));
    assert_eq!(chip.resets(), 1);
    assert_eq!(out(&chip, 0) & 0xFF00_0000, WATCHDOG);
    chip.run_until(Time::from_secs(9));
    assert_eq!(chip.resets(), 10);
    assert_eq!(findings(&chip), [""; 0]);
}

#[test]
fn refreshed_watchdog_does_not_reset_and_a_locked_core_is_reset() {
    let mut program = report_cause();
    program.store(IWDG_KR, 0xCCCC);
    let top = program.here();
    program.store(IWDG_KR, 0xAAAA);
    program.branch(When::Always, top);
    let mut fed = chip(program);
    fed.run_until(Time::from_secs(2));
    assert_eq!(fed.resets(), 0);

    let mut program = report_cause();
    program.store(IWDG_KR, 0xCCCC);
    program.raw(0xDE00);
    program.handler(3);
    program.raw(0xDE00);
    let mut locked = chip(program);
    locked.run_until(Time::from_ms(400));
    assert!(locked.locked_up());
    locked.run_until(Time::from_ms(420));
    assert_eq!(locked.resets(), 1);
    assert_eq!(out(&locked, 0) & 0xFF00_0000, WATCHDOG);
}

#[test]
fn software_reset_keeps_sram_and_restarts_the_program() {
    let mut program = report_cause();
    program.set(0, OUT + 4);
    program.ldr(1, 0, 0);
    program.add(1, 1);
    program.str(1, 0, 0);
    program.set(2, 0xFF);
    program.raw(0x4011); // ands r1, r2
    program.cmp(1, 3);
    let done = program.forward(When::Equal);
    program.store(AIRCR, 0x05FA_0004);
    program.spin();
    program.land(done);
    program.store(OUT + 8, 0xD0);
    program.spin();
    let mut chip = chip(program);
    chip.ram_mut()[4..8].fill(0);
    chip.run_until(Time::from_ms(5));
    assert_eq!((out(&chip, 1), out(&chip, 2)), (3, 0xD0));
    assert_eq!(chip.resets(), 2);
    assert_eq!(out(&chip, 0) & 0xFF00_0000, SOFTWARE);
}

#[test]
fn power_cycle_loses_sram_and_sets_the_power_on_flag() {
    let mut program = report_cause();
    program.spin();
    let mut chip = chip(program);
    chip.run_for(Time::from_ms(3));
    chip.ram_mut()[64..72].copy_from_slice(b"remember");
    chip.reset();
    chip.run_for(Time::from_ms(1));
    assert_eq!(&chip.ram()[64..72], b"remember");
    assert_eq!(out(&chip, 0) & 0xFF00_0000, PIN);
    assert_eq!(chip.resets(), 1);
    chip.cycle();
    assert_ne!(&chip.ram()[64..72], b"remember");
    chip.run_for(Time::from_ms(3));
    assert_eq!(out(&chip, 0) & 0xFF00_0000, POWER_ON);
    assert_eq!(chip.resets(), 0);
    chip.power_off();
    let count = chip.instructions();
    chip.run_for(Time::from_secs(1));
    assert_eq!(chip.instructions(), count);
}
