//! RCC against RM0008 chapter 7.

use super::*;

fn at(rcc: &mut Rcc, us: u64) -> Time {
    let now = Time::from_us(us);
    rcc.advance(now);
    now
}

/// HSE on, PLL x9, APB1 / 2, as the HAL does it for 72 MHz.
#[test]
fn the_pll_from_the_crystal_gives_72_mhz_when_both_are_ready() {
    let mut rcc = Rcc::new(true);
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
    let mut rcc = Rcc::new(false);
    let now = at(&mut rcc, 0);
    rcc.write(0, 0x1_0083, now).unwrap();
    rcc.write(4, 1, now).unwrap();
    let now = at(&mut rcc, 1_000_000_000);
    assert_eq!(rcc.read(0, now).unwrap() & CR_HSERDY, 0);
    assert_eq!(rcc.read(4, now).unwrap() & 0xF, 1, "SW asks, SWS stays");
    assert_eq!(rcc.next_event(), None);
}

#[test]
fn reset_flags_gather_until_rmvf() {
    let mut rcc = Rcc::new(true);
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
    let mut rcc = Rcc::new(true);
    let now = at(&mut rcc, 0);
    rcc.write(0, 0, now).unwrap();
    assert_ne!(rcc.read(0, now).unwrap() & CR_HSIRDY, 0);
}
