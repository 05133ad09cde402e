//! Instants and flags of the timers, calculated by hand from RM0008 15.

use super::*;

const HZ: u32 = 72_000_000;
const CEN: u32 = cr1::CEN;

fn cycles(n: u64) -> Time {
    Time::cycles(n, HZ)
}

fn timer() -> Timer {
    let mut timer = Timer::new(Kind::General);
    timer.set_clock(HZ, Time::ZERO);
    timer
}

fn write(timer: &mut Timer, offset: u32, value: u32, at: Time) {
    timer.advance(at);
    assert_eq!(timer.write(offset, value, at), Ok(()), "{offset:#x}");
}

fn read(timer: &mut Timer, offset: u32, at: Time) -> u32 {
    timer.advance(at);
    timer.read(offset, at).expect("modelled")
}

/// Prescaler 72 - 1, reload `arr`, loaded by UG without UIF.
fn microseconds(arr: u32) -> Timer {
    let mut timer = timer();
    write(&mut timer, offset::PSC, 71, Time::ZERO);
    write(&mut timer, offset::ARR, arr, Time::ZERO);
    write(&mut timer, offset::CR1, cr1::URS, Time::ZERO);
    write(&mut timer, offset::EGR, 1, Time::ZERO);
    write(&mut timer, offset::SR, 0, Time::ZERO);
    timer
}

#[test]
fn one_pulse_fires_once_and_stops() {
    let mut timer = microseconds(1749);
    write(&mut timer, offset::DIER, 1, Time::ZERO);
    let t = Time::from_us(10);
    write(&mut timer, offset::CR1, CEN | cr1::OPM | cr1::URS, t);
    // 1750 us, and one cycle from CEN to the counter.
    let due = t + cycles(1750 * 72 + 1);
    assert_eq!(timer.next_event(), Some(due));
    timer.advance(due - Time::from_ps(1));
    assert!(!timer.irq());
    timer.advance(due);
    assert!(timer.irq() && timer.update_irq());
    assert_eq!(read(&mut timer, offset::CR1, due), cr1::OPM | cr1::URS);
    assert_eq!(read(&mut timer, offset::CNT, due + Time::from_ms(9)), 0);
    write(&mut timer, offset::SR, !1, due);
    assert!(!timer.irq());
    assert_eq!(timer.next_event(), None);
}

#[test]
fn restarting_a_one_pulse_timer_by_cnt_moves_its_end() {
    let mut timer = microseconds(999);
    write(&mut timer, offset::DIER, 1, Time::ZERO);
    write(&mut timer, offset::CR1, CEN | cr1::OPM, Time::ZERO);
    // At tick 600, plus 10 cycles into the next: the prescaler goes on where it is.
    let t = cycles(1 + 600 * 72 + 10);
    assert_eq!(read(&mut timer, offset::CNT, t), 600);
    write(&mut timer, offset::CNT, 0, t);
    assert_eq!(timer.next_event(), Some(cycles(1 + (600 + 1000) * 72)));
}

#[test]
fn ug_sets_uif_unless_urs_and_nothing_with_udis() {
    let mut timer = timer();
    write(&mut timer, offset::EGR, 1, Time::ZERO);
    assert_eq!(read(&mut timer, offset::SR, Time::ZERO) & 1, 1);
    // Compare values of 0 match the restarted counter.
    assert_eq!(read(&mut timer, offset::SR, Time::ZERO), 0x1F);
    write(&mut timer, offset::SR, 0, Time::ZERO);
    write(&mut timer, offset::CR1, cr1::URS, Time::ZERO);
    write(&mut timer, offset::EGR, 1, Time::ZERO);
    assert_eq!(read(&mut timer, offset::SR, Time::ZERO) & 1, 0);
    write(&mut timer, offset::CR1, cr1::UDIS | CEN, Time::ZERO);
    write(&mut timer, offset::PSC, 99, Time::ZERO);
    write(&mut timer, offset::EGR, 1, Time::ZERO);
    assert_eq!(read(&mut timer, offset::SR, Time::ZERO) & 1, 0);
    // The prescaler was not loaded: still one count a cycle.
    assert_eq!(read(&mut timer, offset::CNT, cycles(51)), 50);
}

#[test]
fn flags_of_ug_appear_late_so_that_a_clear_right_after_ug_is_lost() {
    let mut timer = timer().with_ug_delay(4);
    write(&mut timer, offset::DIER, 1, Time::ZERO);
    write(&mut timer, offset::EGR, 1, Time::ZERO);
    write(&mut timer, offset::SR, 0, cycles(2));
    assert_eq!(read(&mut timer, offset::SR, cycles(3)), 0);
    assert_eq!(timer.next_event(), Some(cycles(4)));
    timer.advance(cycles(4));
    assert!(timer.irq());
    assert_eq!(read(&mut timer, offset::SR, cycles(4)), 0x1F);
    // The prescaler, the counter and the flags of the counter itself are not late.
    write(&mut timer, offset::CNT, 7, cycles(5));
    write(&mut timer, offset::EGR, 1, cycles(5));
    assert_eq!(read(&mut timer, offset::CNT, cycles(5)), 0);
    timer.reset(cycles(6));
    assert_eq!(read(&mut timer, offset::SR, cycles(20)), 0);
    assert_eq!(timer.ug_delay, 4, "a property of the part");
}

#[test]
fn the_prescaler_is_loaded_at_the_update() {
    let mut timer = timer();
    write(&mut timer, offset::ARR, 9, Time::ZERO);
    write(&mut timer, offset::CR1, CEN, Time::ZERO);
    write(&mut timer, offset::PSC, 3, cycles(5));
    assert_eq!(read(&mut timer, offset::PSC, cycles(5)), 3);
    assert_eq!(read(&mut timer, offset::CNT, cycles(10)), 9);
    // Update at cycle 11; from there four cycles a count.
    assert_eq!(read(&mut timer, offset::CNT, cycles(11)), 0);
    assert_eq!(read(&mut timer, offset::CNT, cycles(14)), 0);
    assert_eq!(read(&mut timer, offset::CNT, cycles(15)), 1);
}

#[test]
fn reload_preload_waits_for_the_update() {
    for (arpe, second) in [(0, 11 + 6), (cr1::ARPE, 11 + 10)] {
        let mut timer = timer();
        write(&mut timer, offset::ARR, 9, Time::ZERO);
        write(&mut timer, offset::CR1, CEN | arpe, Time::ZERO);
        write(&mut timer, offset::DIER, 1, Time::ZERO);
        write(&mut timer, offset::EGR, 1, Time::ZERO);
        write(&mut timer, offset::SR, 0, Time::ZERO);
        timer.advance(cycles(11));
        write(&mut timer, offset::SR, 0, cycles(11));
        write(&mut timer, offset::ARR, 5, cycles(12));
        assert_eq!(timer.next_event(), Some(cycles(second)), "ARPE {arpe}");
        // The period after that is the new one either way.
        timer.advance(cycles(second));
        write(&mut timer, offset::SR, 0, cycles(second));
        assert_eq!(timer.next_event(), Some(cycles(second + 6)));
    }
}

#[test]
fn a_thousand_hertz_for_an_hour_is_exact() {
    let mut timer = microseconds(999);
    write(&mut timer, offset::DIER, 1, Time::ZERO);
    write(&mut timer, offset::CR1, CEN, Time::ZERO);
    for n in 1..=10_000 {
        let at = timer.next_event().expect("runs");
        assert_eq!(at, cycles(1 + 72_000 * n));
        timer.advance(at);
        assert!(timer.irq());
        write(&mut timer, offset::SR, 0, at);
    }
    // Without an enabled interrupt there are no events. After an hour without an access the count is right.
    let hour = cycles(1 + 72_000_000 * 3600 + 72 * 250);
    write(&mut timer, offset::DIER, 0, cycles(1 + 72_000 * 10_000));
    assert_eq!(timer.next_event(), None);
    assert_eq!(read(&mut timer, offset::CNT, hour), 250);
    assert_eq!(read(&mut timer, offset::SR, hour) & 1, 1);
}

#[test]
fn compare_flags_rise_at_their_counts() {
    let mut timer = microseconds(1749);
    write(&mut timer, offset::CCR1, 750, Time::ZERO);
    write(&mut timer, offset::CCR1 + 4, 5000, Time::ZERO);
    write(&mut timer, offset::DIER, 0b10, Time::ZERO);
    write(&mut timer, offset::CR1, CEN | cr1::OPM, Time::ZERO);
    let t15 = cycles(1 + 750 * 72);
    assert_eq!(timer.next_event(), Some(t15));
    timer.advance(t15);
    assert!(timer.irq() && timer.capture_compare_irq() && !timer.update_irq());
    assert_eq!(read(&mut timer, offset::SR, t15), 0b10);
    // Past the reload value: at the overflow. Channels 3 and 4 compare with 0.
    let end = cycles(1 + 1750 * 72);
    assert_eq!(read(&mut timer, offset::SR, end), 0x1F);
}

#[test]
fn count_past_the_reload_value_wraps_without_an_update() {
    let mut timer = timer();
    write(&mut timer, offset::CNT, 100, Time::ZERO);
    write(&mut timer, offset::CR1, CEN, Time::ZERO);
    write(&mut timer, offset::ARR, 49, Time::ZERO);
    write(&mut timer, offset::DIER, 1, Time::ZERO);
    let wrap = cycles(1 + 0x1_0000 - 100);
    assert_eq!(read(&mut timer, offset::CNT, wrap), 0);
    assert_eq!(read(&mut timer, offset::SR, wrap) & 1, 0);
    assert_eq!(timer.next_event(), Some(wrap + cycles(50)));
    // Reload 0 blocks the counter.
    write(&mut timer, offset::ARR, 0, wrap);
    assert_eq!(timer.next_event(), None);
}

#[test]
fn a_changed_clock_goes_on_from_the_count() {
    let mut timer = timer();
    write(&mut timer, offset::CR1, CEN, Time::ZERO);
    let t = cycles(1001);
    timer.set_clock(8_000_000, t);
    assert_eq!(read(&mut timer, offset::CNT, t), 1000);
    assert_eq!(read(&mut timer, offset::CNT, t + Time::from_us(1)), 1008);
}

/// TIM1 with channel 3 capturing falling edges, counting cycles.
fn capturing() -> Timer {
    let mut timer = Timer::new(Kind::Advanced);
    timer.set_clock(HZ, Time::ZERO);
    write(&mut timer, offset::CCMR2, 1, Time::ZERO);
    write(&mut timer, offset::CCER, 3 << 8, Time::ZERO);
    write(&mut timer, offset::CR1, CEN, Time::ZERO);
    timer
}

#[test]
fn a_falling_edge_is_captured_with_its_count() {
    let mut timer = capturing();
    timer.capture_edge(3, cycles(501), false);
    timer.capture_edge(3, cycles(600), true);
    timer.capture_edge(4, cycles(600), false);
    assert_eq!(read(&mut timer, offset::SR, cycles(10_000)), compare(2));
    assert_eq!(read(&mut timer, offset::CCR1 + 8, cycles(10_000)), 500);
    // Reading the value cleared the flag.
    assert_eq!(read(&mut timer, offset::SR, cycles(10_000)), 0);
    timer.capture_edge(3, cycles(20_001), false);
    timer.capture_edge(3, cycles(30_001), false);
    let sr = read(&mut timer, offset::SR, cycles(40_000));
    assert_eq!(sr, compare(2) | OVERCAPTURE << 2);
    assert_eq!(read(&mut timer, offset::CCR1 + 8, cycles(40_000)), 30_000);
    write(&mut timer, offset::SR, 0, cycles(40_000));
    assert!(!timer.capture_interrupt_enabled(3));
    write(&mut timer, offset::DIER, compare(2), cycles(40_000));
    assert!(timer.capture_interrupt_enabled(3));
    timer.capture_edge(3, cycles(41_000), false);
    assert!(timer.capture_compare_irq() && !timer.update_irq());
    // A captured value is read only.
    write(&mut timer, offset::CCR1 + 8, 7, cycles(41_000));
    assert_eq!(timer.counter.compare[2].preload, 40_999);
}

#[test]
fn features_not_modelled_are_reported() {
    let mut timer = capturing();
    for (offset, value) in [
        (offset::CR1, 1 << 4),
        (offset::CR2, 0x20),
        (offset::SMCR, 4),
        (offset::DIER, 1 << 8),
        (offset::EGR, 1 << 6),
        // A filter on channel 4's capture, and a selection changed while channel 3 is on.
        (offset::CCMR2, 0x1101 | 1 << 12),
        (offset::CCMR2, 0),
        (offset::RCR, 1),
        (0x48, 0),
    ] {
        assert!(
            timer.write(offset, value, Time::ZERO).is_err(),
            "{offset:#x}"
        );
    }
    assert_eq!(timer.selection(2), 1);
    let mut general = self::timer();
    assert!(general.read(offset::BDTR, Time::ZERO).is_err());
    // PWM is fine until it drives a pin; on TIM1 also until MOE.
    write(&mut general, offset::CCMR1, 0x60, Time::ZERO);
    assert!(general.write(offset::CCER, 1, Time::ZERO).is_err());
    let mut advanced = Timer::new(Kind::Advanced);
    write(&mut advanced, offset::CCMR1, 0x60, Time::ZERO);
    write(&mut advanced, offset::CCER, 1, Time::ZERO);
    assert!(advanced.write(offset::BDTR, MOE, Time::ZERO).is_err());
}
