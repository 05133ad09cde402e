//! The crystal fails while the part runs from it, and returns.

use f103::{Chip, Time};

use super::asm::{Asm, When};
use super::regs::*;
use super::{chip, findings, out, to_72_mhz};

const CSSON: u32 = 1 << 19;
const RCC_CIR: u32 = 0x4002_1008;
const CSSF: u32 = 1 << 7;
const CSSC: u32 = 1 << 23;

/// Time after power-on from which every program here runs from the crystal.
const RUNNING: Time = Time::from_ms(10);

/// Starts the crystal and 72 MHz from it, with or without the clock security system.
fn fast(security: bool) -> Asm {
    let cr = 0x1_0083 | if security { CSSON } else { 0 };
    let mut program = Asm::new();
    to_72_mhz(&mut program, cr);
    program.set(6, 0);
    program
}

/// An endless loop. Its NMI handler counts its entries in r6, stores RCC's registers, and clears CSSF in its `clears`th
/// round.
fn with_handler(mut program: Asm, clears: u16) -> Chip<()> {
    program.spin();
    program.handler(2);
    program.add(6, 1);
    program.copy(RCC_CR, OUT);
    program.copy(RCC_CFGR, OUT + 4);
    program.copy(RCC_CIR, OUT + 8);
    program.cmp(6, clears);
    let not_yet = program.forward(When::NotEqual);
    program.store(RCC_CIR, CSSC);
    program.copy(RCC_CIR, OUT + 12);
    program.land(not_yet);
    program.bx(14);
    chip(program)
}

#[test]
fn clock_security_system_selects_the_hsi_and_raises_the_nmi() {
    let mut chip = with_handler(fast(true), 1);
    chip.run_until(RUNNING);
    assert_eq!((chip.hclk(), chip.register(6)), (72_000_000, Some(0)));
    chip.set_crystal(false);
    assert!(!chip.crystal());
    chip.step(1);
    assert_eq!(
        chip.register(16).unwrap() & 0x1FF,
        2,
        "the NMI follows immediately"
    );
    assert_eq!(chip.hclk(), 8_000_000);
    chip.run_for(Time::from_ms(1));
    assert_eq!(chip.register(6), Some(1), "once");
    let [cr, cfgr, cir, cleared] = [0, 1, 2, 3].map(|n| out(&chip, n));
    // HSEON, HSERDY, PLLON and PLLRDY are off, HSION and HSIRDY on.
    assert_eq!(cr & 0x0303_0003, 3, "{cr:#x}");
    assert_eq!(cfgr & 0xF, 0, "SW and SWS select the HSI: {cfgr:#x}");
    assert_eq!((cir & CSSF, cleared & CSSF), (CSSF, 0));
    // A NOP, and a branch with the wait states of its target: 6 cycles for 2 instructions, now at 8 MHz.
    let before = (chip.now(), chip.instructions());
    chip.step(64_000);
    assert_eq!(
        chip.now() - before.0,
        Time::cycles(192_000, 8_000_000),
        "the core runs at the HSI's rate"
    );
    assert_eq!(findings(&chip), [""; 0]);
}

#[test]
fn nmi_is_raised_again_until_cssc_is_written() {
    let mut chip = with_handler(fast(true), 5);
    chip.run_until(RUNNING);
    chip.set_crystal(false);
    chip.run_for(Time::from_ms(1));
    assert_eq!(chip.register(6), Some(5));
    assert_eq!(chip.register(16).unwrap() & 0x1FF, 0, "back in the loop");
    chip.run_for(Time::from_ms(10));
    assert_eq!(chip.register(6), Some(5));
}

#[test]
fn nmi_wakes_a_sleeping_core() {
    let mut program = fast(true);
    program.wfi();
    let mut chip = with_handler(program, 1);
    chip.run_until(RUNNING);
    assert!(chip.asleep());
    chip.set_crystal(false);
    chip.run_for(Time::from_ms(1));
    assert_eq!(chip.register(6), Some(1));
    assert!(!chip.asleep());
}

#[test]
fn without_the_security_system_the_core_stops_until_the_crystal_is_back() {
    let mut chip = with_handler(fast(false), 1);
    chip.run_until(RUNNING);
    chip.set_crystal(false);
    let done = chip.instructions();
    let died = chip.now();
    chip.run_for(Time::from_secs(1));
    assert_eq!((chip.instructions(), chip.hclk()), (done, 0));
    assert_eq!(chip.now(), died + Time::from_secs(1), "time passes");
    chip.step(10);
    assert_eq!(chip.instructions(), done, "the core executes nothing");
    assert_eq!(findings(&chip).len(), 1);
    assert!(findings(&chip)[0].contains("clock security system off"));
    let back = chip.now();
    chip.set_crystal(true);
    chip.step(1);
    assert_eq!(
        chip.now().as_us() - back.as_us(),
        2_200,
        "crystal and PLL start"
    );
    chip.step(64_000);
    assert_eq!((chip.hclk(), chip.register(6)), (72_000_000, Some(0)));
}

#[test]
fn watchdog_restarts_a_core_without_a_clock() {
    let mut program = fast(false);
    program.store(IWDG_KR, 0xCCCC);
    let mut chip = with_handler(program, 1);
    chip.run_until(RUNNING);
    chip.set_crystal(false);
    // 4096 x 4 / 40 kHz are 409.6 ms. The program then waits for the crystal without success.
    chip.run_for(Time::from_ms(420));
    assert_eq!((chip.resets(), chip.hclk()), (1, 8_000_000));
    let done = chip.instructions();
    chip.run_for(Time::from_ms(1));
    assert!(chip.instructions() > done);
}

#[test]
fn rates_of_the_rc_oscillators_change_the_core_and_the_watchdog() {
    let mut program = Asm::new();
    program.store(IWDG_KR, 0xCCCC);
    let mut chip = with_handler(program, 1);
    assert_eq!(chip.rc_oscillators(), (8_000_000, 40_000));
    chip.set_rc_oscillators(8_200_000, 20_000).unwrap();
    assert_eq!(chip.hclk(), 8_200_000);
    // The same instructions take as many cycles as at the typical rate.
    let before = (chip.now(), chip.cycles());
    chip.step(64_000);
    let cycles = chip.cycles() - before.1;
    assert!(cycles > 64_000);
    assert_eq!(
        (chip.now() - before.0).as_ns(),
        Time::cycles(cycles, 8_200_000).as_ns(),
        "the core runs at the HSI's rate"
    );
    // 4096 x 4 / 20 kHz are 819.2 ms, counted from shortly after the start.
    chip.run_until(Time::from_ms(800));
    assert_eq!(chip.resets(), 0);
    chip.run_until(Time::from_ms(840));
    assert_eq!(chip.resets(), 1);
    for (hsi, lsi) in [
        (6_399_999, 40_000),
        (9_600_001, 40_000),
        (8_000_000, 14_999),
    ] {
        assert!(chip.set_rc_oscillators(hsi, lsi).is_err());
    }
    assert_eq!(chip.rc_oscillators(), (8_200_000, 20_000));
}
