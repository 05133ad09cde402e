//! RCC against RM0008 chapter 7.

use super::*;
use crate::part::STM32F103CB;
use crate::peripheral::Peripheral;

fn at(rcc: &mut Rcc, us: u64) -> Time {
    let now = Time::from_us(us);
    rcc.advance(now);
    now
}

/// HSE on, PLL x9, APB1 / 2, in the sequence that the HAL uses for 72 MHz.
#[test]
fn the_pll_from_the_crystal_gives_72_mhz_when_both_are_ready() {
    let mut rcc = Rcc::new(true, Oscillators::TYPICAL, STM32F103CB.clock_enables);
    let now = at(&mut rcc, 10);
    rcc.write(0, 0x1_0083, now).unwrap();
    assert_eq!(rcc.read(0, now).unwrap() & CR_HSERDY, 0);
    let now = at(&mut rcc, 2_010);
    assert_ne!(rcc.read(0, now).unwrap() & CR_HSERDY, 0);
    rcc.write(4, 0x001D_0400, now).unwrap();
    rcc.write(0, 0x0101_0083, now).unwrap();
    rcc.write(4, 0x001D_0402, now).unwrap();
    assert_eq!(rcc.next_event(), Some(Time::from_us(2_210)));
    assert_eq!(rcc.clocks().hclk, 8_000_000, "not before the PLL locks");
    let now = at(&mut rcc, 2_210);
    assert_eq!(rcc.read(4, now).unwrap() & 0xF, 0b1010);
    let clocks = rcc.clocks();
    assert_eq!(
        (clocks.hclk, clocks.pclk1, clocks.pclk2, clocks.apb1_timers),
        (72_000_000, 36_000_000, 72_000_000, 72_000_000)
    );
}

#[test]
fn a_dead_crystal_never_gets_ready() {
    let mut rcc = Rcc::new(false, Oscillators::TYPICAL, STM32F103CB.clock_enables);
    let now = at(&mut rcc, 0);
    rcc.write(0, 0x1_0083, now).unwrap();
    rcc.write(4, 1, now).unwrap();
    let now = at(&mut rcc, 1_000_000_000);
    assert_eq!(rcc.read(0, now).unwrap() & CR_HSERDY, 0);
    assert_eq!(rcc.read(4, now).unwrap() & 0xF, 1, "SW asks, SWS stays");
    assert_eq!(rcc.next_event(), None);
}

#[test]
fn reset_flags_accumulate_until_rmvf() {
    let mut rcc = Rcc::new(true, Oscillators::TYPICAL, STM32F103CB.clock_enables);
    assert_eq!(rcc.read(0x24, Time::ZERO).unwrap(), 0x0C00_0000);
    rcc.note_reset(Cause::Iwdg);
    rcc.reset(Time::ZERO);
    assert_eq!(rcc.read(0x24, Time::ZERO).unwrap(), 0x2C00_0000);
    rcc.write(0x24, CSR_RMVF, Time::ZERO).unwrap();
    assert_eq!(rcc.read(0x24, Time::ZERO).unwrap(), 0);
    rcc.note_reset(Cause::Software);
    assert_eq!(rcc.read(0x24, Time::ZERO).unwrap(), 0x1400_0000);
}

#[test]
fn the_clock_in_use_cannot_be_stopped() {
    let mut rcc = Rcc::new(true, Oscillators::TYPICAL, STM32F103CB.clock_enables);
    let now = at(&mut rcc, 0);
    rcc.write(0, 0, now).unwrap();
    assert_ne!(rcc.read(0, now).unwrap() & CR_HSIRDY, 0);
}

/// 72 MHz from the crystal, with the clock security system on.
fn secured() -> Rcc {
    let mut rcc = Rcc::new(true, Oscillators::TYPICAL, STM32F103CB.clock_enables);
    let now = at(&mut rcc, 0);
    rcc.write(0, 0x9_0083, now).unwrap();
    rcc.write(4, 0x001D_0400, now).unwrap();
    rcc.write(0, 0x0109_0083, now).unwrap();
    rcc.write(4, 0x001D_0402, now).unwrap();
    at(&mut rcc, 5_000);
    assert_eq!(rcc.clocks().sysclk, 72_000_000);
    rcc
}

#[test]
fn after_a_failure_the_crystal_can_be_taken_into_use_again() {
    let mut rcc = secured();
    let now = at(&mut rcc, 6_000);
    rcc.set_crystal(false, now);
    assert!(rcc.nmi() && !rcc.stopped());
    assert_eq!(rcc.clocks().sysclk, 8_000_000);
    assert_eq!(rcc.read(4, now).unwrap(), 0x001D_0400);
    rcc.write(8, CIR_CSSC, now).unwrap();
    assert!(!rcc.nmi());
    // The crystal works again, but the HSE stays off until it is switched on again.
    let now = at(&mut rcc, 7_000);
    rcc.set_crystal(true, now);
    let now = at(&mut rcc, 17_000);
    assert_eq!(rcc.read(0, now).unwrap() & (CR_HSEON | CR_HSERDY), 0);
    rcc.write(0, 0x9_0083, now).unwrap();
    let now = at(&mut rcc, 19_000);
    assert_ne!(rcc.read(0, now).unwrap() & CR_HSERDY, 0);
    rcc.set_crystal(false, now);
    assert!(rcc.nmi(), "and it is watched again");
}

#[test]
fn a_crystal_that_dies_while_it_starts_is_no_failure() {
    let mut rcc = Rcc::new(true, Oscillators::TYPICAL, STM32F103CB.clock_enables);
    let now = at(&mut rcc, 0);
    rcc.write(0, 0x9_0083, now).unwrap();
    let now = at(&mut rcc, 1_000);
    rcc.set_crystal(false, now);
    let now = at(&mut rcc, 9_000);
    assert!(!rcc.nmi());
    assert_eq!(rcc.read(0, now).unwrap() & CR_HSERDY, 0);
    rcc.set_crystal(true, now);
    let now = at(&mut rcc, 11_000);
    assert_ne!(rcc.read(0, now).unwrap() & CR_HSERDY, 0, "it starts anew");
}

#[test]
fn the_security_system_can_be_switched_off() {
    let mut rcc = secured();
    let now = at(&mut rcc, 6_000);
    rcc.write(0, 0x0101_0083, now).unwrap();
    rcc.set_crystal(false, now);
    assert!(!rcc.nmi() && rcc.stopped());
    assert_eq!(rcc.clocks(), Clocks::STOPPED);
    assert_eq!(rcc.next_event(), None);
    rcc.set_crystal(true, now);
    assert_eq!(rcc.next_event(), Some(Time::from_us(8_200)));
    at(&mut rcc, 8_200);
    assert_eq!(rcc.clocks().sysclk, 72_000_000);
}

#[test]
fn pll_fed_by_the_hsi_keeps_running_when_the_crystal_fails() {
    let mut rcc = Rcc::new(true, Oscillators::TYPICAL, STM32F103CB.clock_enables);
    let now = at(&mut rcc, 0);
    rcc.write(4, 0x0038_0400, now).unwrap();
    rcc.write(0, 0x0109_0083, now).unwrap();
    rcc.write(4, 0x0038_0402, now).unwrap();
    let now = at(&mut rcc, 5_000);
    assert_eq!(rcc.clocks().sysclk, 64_000_000);
    rcc.set_crystal(false, now);
    assert!(rcc.nmi());
    assert_eq!(rcc.clocks().sysclk, 64_000_000);
}

#[test]
fn pll_settings_written_before_pllrdy_has_fallen_are_refused() {
    let mut rcc = secured();
    let now = at(&mut rcc, 6_000);
    assert!(rcc.write(4, 0x0039_0402, now).is_err(), "the PLL runs");
    rcc.write(4, 0x001D_0400, now).unwrap();
    rcc.write(0, 0x0009_0083, now).unwrap();
    let now = at(&mut rcc, 6_009);
    assert_ne!(rcc.read(0, now).unwrap() & CR_PLLRDY, 0);
    assert!(rcc.write(4, 0x0019_0400, now).is_err());
    let now = at(&mut rcc, 6_010);
    assert_eq!(rcc.read(0, now).unwrap() & CR_PLLRDY, 0);
    assert_eq!(rcc.write(4, 0x0015_0400, now), Ok(()));
}

#[test]
fn pll_without_its_source_and_switch_to_a_clock_that_is_off_are_refused() {
    let mut rcc = Rcc::new(true, Oscillators::TYPICAL, STM32F103CB.clock_enables);
    let now = at(&mut rcc, 10);
    assert!(rcc.write(4, 1, now).is_err(), "the HSE is off");
    assert!(rcc.write(4, 0x001D_0402, now).is_err(), "the PLL is off");
    rcc.write(4, 0x001D_0400, now).unwrap();
    assert!(rcc.write(0, 0x0100_0083, now).is_err(), "the HSE is off");
    rcc.write(0, 0x83, now).unwrap();
    // Both at once: the PLL waits for the crystal.
    rcc.write(0, 0x0101_0083, now).unwrap();
    rcc.write(4, 0x001D_0402, now).unwrap();
}
