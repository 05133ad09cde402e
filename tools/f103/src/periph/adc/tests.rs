//! Times and codes of conversions against the figures in RM0008 11 and DS5319.

use super::*;

const HZ: u32 = 12_000_000;
const ON: u32 = cr2::ADON | cr2::EXTTRIG | cr2::EXTSEL;

fn cycles(n: u64) -> Time {
    Time::cycles(n, HZ)
}

/// On, settled and calibrated, at 12 MHz (72 MHz / 6).
fn settled() -> (Adc, Time) {
    let mut adc = Adc::default();
    adc.set_clock(HZ, Time::ZERO);
    adc.write(offset::CR2, ON, Time::ZERO).expect("modelled");
    write(&mut adc, offset::CR2, ON | cr2::CAL, Time::from_us(2));
    (adc, Time::from_us(10))
}

/// Returns a conversion of channel 0 with sampling time `code`, begun at `at`.
fn converted(adc: &mut Adc, code: u32, at: Time) -> u16 {
    write(adc, offset::SMPR2, code, at);
    adc.advance(at);
    // Another test checks the findings.
    let _ = adc.write(offset::CR2, ON | cr2::SWSTART, at);
    let done = at + Time::from_us(40);
    read(adc, offset::DR, done) as u16
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
fn calibration_clears_its_bit_at_its_end() {
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
fn each_conversion_of_a_continuous_scan_requests_a_transfer() {
    let (mut adc, t) = settled();
    adc.set_millivolts(1, 1650, t);
    write(&mut adc, offset::CR1, cr1::SCAN, t);
    write(&mut adc, offset::SQR1, 1 << 20, t);
    write(&mut adc, offset::SQR3, 1 << 5, t);
    let on = ON | cr2::DMA | cr2::CONT;
    write(&mut adc, offset::CR2, on, t);
    write(&mut adc, offset::CR2, on | cr2::SWSTART, t);
    for (n, code) in [(1, 0), (2, 2048), (3, 0), (4, 2048)] {
        // 1.5 + 12.5 cycles.
        let end = t + cycles(14 * n);
        assert_eq!(
            (adc.next_event(), adc.dma_requests()[0]),
            (Some(end), false)
        );
        adc.advance(end);
        assert!(adc.dma_requests()[0]);
        assert_eq!(adc.read(offset::DR, end), Ok(code));
    }
}

#[test]
fn misuse_is_reported() {
    let mut adc = Adc::default();
    adc.set_clock(18_000_000, Time::ZERO);
    let now = Time::from_us(10);
    assert!(adc.write(offset::CR2, cr2::SWSTART, now).is_err(), "off");
    let injected = adc.write(offset::CR2, ON | 1 << 15, now);
    assert!(injected.is_err(), "JEXTTRIG");
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

#[test]
fn codes_are_off_until_a_calibration_is_complete_and_after_each_power_up() {
    let mut adc = Adc::default();
    adc.set_clock(HZ, Time::ZERO);
    adc.set_millivolts(0, 1650, Time::ZERO);
    write(&mut adc, offset::CR2, ON, Time::ZERO);
    let at = |n: u64| Time::from_us(100 * n);
    assert_eq!(converted(&mut adc, 5, at(1)), 2048 + UNCALIBRATED);
    write(&mut adc, offset::CR2, ON | cr2::CAL, at(2));
    assert_eq!(converted(&mut adc, 5, at(3)), 2048);
    write(&mut adc, offset::CR2, ON | cr2::RSTCAL, at(4));
    assert_eq!(converted(&mut adc, 5, at(5)), 2048 + UNCALIBRATED);
    write(&mut adc, offset::CR2, ON | cr2::CAL, at(6));
    write(&mut adc, offset::CR2, 0, at(7));
    write(&mut adc, offset::CR2, ON, at(8));
    assert_eq!(converted(&mut adc, 5, at(9)), 2048 + UNCALIBRATED);
    // A calibration begun within two cycles of power-up has no effect (11.4).
    write(&mut adc, offset::CR2, 0, at(10));
    write(&mut adc, offset::CR2, ON, at(11));
    assert!(adc.write(offset::CR2, ON | cr2::CAL, at(11)).is_err());
    assert_eq!(converted(&mut adc, 5, at(12)), 2048 + UNCALIBRATED);
}

#[test]
fn conversion_within_the_settling_time_is_too_low() {
    let mut adc = Adc::default();
    adc.set_clock(HZ, Time::ZERO);
    adc.set_millivolts(0, 1650, Time::ZERO);
    write(&mut adc, offset::CR2, ON, Time::ZERO);
    assert_eq!(
        converted(&mut adc, 0, Time::from_ns(500)),
        2048 + UNCALIBRATED - UNSETTLED
    );
}

/// The data sheet's table of RAIN against the sampling time at 14 MHz, in ohms; its limit is the last of the
/// values for 55.5 cycles and more.
#[test]
fn source_above_the_data_sheet_s_impedance_is_read_wrong() {
    const LIMITS: [u32; 6] = [400, 5_900, 11_400, 25_200, 37_200, 50_000];
    for (code, limit) in (0..).zip(LIMITS) {
        let read = |ohms| {
            let (mut adc, t) = settled();
            adc.set_clock(14_000_000, t);
            adc.set_millivolts(0, 3300, t);
            adc.set_source_ohms(0, ohms, t);
            converted(&mut adc, code, t)
        };
        assert_eq!(read(limit), 4095, "{limit} ohm");
        assert!(read(2 * limit + 1_000) < 4090, "{limit} ohm");
    }
}

#[test]
fn source_of_high_impedance_is_pulled_to_the_level_converted_before() {
    let (mut adc, t) = settled();
    adc.set_millivolts(0, 3300, t);
    assert_eq!(converted(&mut adc, 5, t), 4095);
    let t = t + Time::from_us(100);
    adc.set_millivolts(0, 0, t);
    adc.set_source_ohms(0, 500_000, t);
    let first = converted(&mut adc, 5, t);
    let second = converted(&mut adc, 5, t + Time::from_us(100));
    assert!((1000..1500).contains(&first), "{first}");
    assert!(second < first / 2, "{second}");
}
