//! Times and codes of conversions, by the numbers of RM0008 11 and DS5319.

use super::*;

const HZ: u32 = 12_000_000;
const ON: u32 = cr2::ADON | cr2::EXTTRIG | cr2::EXTSEL;

fn cycles(n: u64) -> Time {
    Time::cycles(n, HZ)
}

/// On and settled, at 12 MHz (72 MHz / 6).
fn settled() -> (Adc, Time) {
    let mut adc = Adc::new();
    adc.set_clock(HZ, Time::ZERO);
    adc.write(offset::CR2, ON, Time::ZERO).expect("modelled");
    (adc, Time::from_us(2))
}

fn write(adc: &mut Adc, offset: u32, value: u32, at: Time) {
    adc.advance(at);
    assert_eq!(adc.write(offset, value, at), Ok(()), "{offset:#x}");
}

fn read(adc: &mut Adc, offset: u32, at: Time) -> u32 {
    adc.advance(at);
    adc.read(offset, at).expect("modelled")
}

#[test]
fn a_conversion_takes_its_sample_time_and_twelve_and_a_half_cycles() {
    let (mut adc, t) = settled();
    adc.set_millivolts(1, 1650, t);
    write(&mut adc, offset::SMPR2, 5 << 3, t);
    write(&mut adc, offset::SQR3, 1, t);
    write(&mut adc, offset::CR2, ON | cr2::SWSTART, t);
    // 55.5 + 12.5 = 68 cycles.
    let done = t + cycles(68);
    assert_eq!(
        read(&mut adc, offset::SR, done - Time::from_ps(1)),
        sr::STRT
    );
    assert_eq!(read(&mut adc, offset::SR, done), sr::STRT | sr::EOC);
    assert_eq!(read(&mut adc, offset::CR2, done), ON);
    assert_eq!(read(&mut adc, offset::DR, done), 2048);
    assert_eq!(read(&mut adc, offset::SR, done), sr::STRT);
    assert_eq!(adc.next_event(), None);
}

#[test]
fn the_level_at_the_end_of_sampling_counts() {
    let (mut adc, t) = settled();
    write(&mut adc, offset::SMPR2, 7, t);
    write(&mut adc, offset::CR2, ON | cr2::SWSTART, t);
    let sampled = t + Time::cycles(479, 2 * HZ);
    adc.set_millivolts(0, 3300, sampled - Time::from_ps(1));
    adc.set_millivolts(0, 0, sampled);
    assert_eq!(read(&mut adc, offset::DR, t + cycles(252)), 4095);
}

#[test]
fn adon_written_twice_starts_but_not_with_another_change() {
    let (mut adc, t) = settled();
    write(&mut adc, offset::CR2, ON | cr2::ALIGN, t);
    assert_eq!(read(&mut adc, offset::SR, t), 0);
    adc.set_millivolts(0, 825, t);
    write(&mut adc, offset::CR2, ON | cr2::ALIGN, t);
    // 1.5 + 12.5 = 14 cycles; left aligned.
    assert_eq!(
        read(&mut adc, offset::SR, t + cycles(14)),
        sr::STRT | sr::EOC
    );
    assert_eq!(read(&mut adc, offset::DR, t + cycles(14)), 1024 << 4);
}

#[test]
fn calibration_ends_by_itself() {
    let (mut adc, t) = settled();
    write(&mut adc, offset::CR2, ON | cr2::RSTCAL, t);
    assert_eq!(read(&mut adc, offset::CR2, t + cycles(3)), ON | cr2::RSTCAL);
    let t = t + cycles(4);
    assert_eq!(read(&mut adc, offset::CR2, t), ON);
    write(&mut adc, offset::CR2, ON | cr2::CAL, t);
    assert_eq!(read(&mut adc, offset::CR2, t + cycles(82)), ON | cr2::CAL);
    assert_eq!(read(&mut adc, offset::CR2, t + cycles(83)), ON);
}

#[test]
fn a_scan_ends_with_eoc_and_continuous_mode_goes_on() {
    let (mut adc, t) = settled();
    adc.set_millivolts(0, 100, t);
    adc.set_millivolts(3, 3000, t);
    write(&mut adc, offset::SQR1, 1 << 20, t);
    write(&mut adc, offset::SQR3, 3 << 5, t);
    write(&mut adc, offset::CR1, cr1::SCAN | cr1::EOCIE, t);
    let go = ON | cr2::CONT;
    write(&mut adc, offset::CR2, go, t);
    write(&mut adc, offset::CR2, go | cr2::SWSTART, t);
    assert_eq!(adc.next_event(), Some(t + cycles(14)));
    adc.advance(t + cycles(14));
    assert!(!adc.irq());
    assert_eq!(adc.next_event(), Some(t + cycles(28)));
    adc.advance(t + cycles(28));
    assert!(adc.irq());
    // 3000 mV: 3000 * 4096 / 3300 = 3723.6.
    assert_eq!(read(&mut adc, offset::DR, t + cycles(28)), 3724);
    assert!(!adc.irq());
    assert_eq!(
        read(&mut adc, offset::SR, t + cycles(28 * 1001)) & sr::EOC,
        sr::EOC
    );
    write(&mut adc, offset::CR2, 0, t + cycles(28 * 1001));
    assert_eq!(read(&mut adc, offset::DR, t + cycles(99_999)), 3724);
    assert!(!adc.irq());
}

#[test]
fn internal_channels_have_their_typical_values() {
    let (mut adc, t) = settled();
    write(&mut adc, offset::CR2, ON | cr2::TSVREFE, t);
    for (channel, code) in [(16, 1775), (17, 1489)] {
        write(&mut adc, offset::SQR3, channel, t);
        write(&mut adc, offset::CR2, ON | cr2::TSVREFE | cr2::SWSTART, t);
        assert_eq!(read(&mut adc, offset::DR, t + cycles(14)), code);
    }
    adc.advance(t + cycles(14));
    let asked = adc.write(offset::CR2, ON | cr2::SWSTART, t + cycles(14));
    assert!(asked.is_err(), "TSVREFE is off");
}

#[test]
fn misuse_is_reported() {
    let mut adc = Adc::new();
    adc.set_clock(18_000_000, Time::ZERO);
    let now = Time::from_us(10);
    assert!(adc.write(offset::CR2, cr2::SWSTART, now).is_err(), "off");
    assert!(adc.write(offset::CR2, ON | 1 << 8, now).is_err(), "DMA");
    assert!(adc.write(offset::CR2, ON, now).is_ok());
    let start = ON | cr2::SWSTART;
    let fast = adc.write(offset::CR2, start, now + Time::from_us(5));
    assert_eq!(
        fast,
        Err(Unmodelled("ADC conversion with ADCCLK above 14 MHz"))
    );
    adc.set_clock(HZ, now);
    assert!(adc.write(offset::CR2, 0, now).is_ok());
    assert!(adc.write(offset::CR2, ON, now).is_ok());
    assert!(
        adc.write(offset::CR2, start, now + Time::from_ns(999))
            .is_err(),
        "tSTAB"
    );
    assert!(
        adc.write(offset::CR1, 1 << 11, now).is_err(),
        "discontinuous"
    );
    assert!(adc.read(0x3C, now).is_err(), "injected data");
}
