//! A port against RM0008 chapter 9.

use super::*;

const NOW: Time = Time::ZERO;

#[test]
fn pulls_follow_odr_and_the_outside_wins() {
    let mut port = Gpio::default();
    assert_eq!(port.read(8, NOW), Ok(0), "floating reads low");
    port.write(0x10, 0x10, NOW).unwrap();
    port.write(0, 0x4448_4444, NOW).unwrap();
    assert_eq!(port.read(8, NOW), Ok(0x10), "pulled up");
    port.drive(4, Drive::Low, NOW);
    assert_eq!(port.read(8, NOW), Ok(0));
    port.drive(4, Drive::Floating, NOW);
    port.write(0x14, 0x10, NOW).unwrap();
    assert_eq!(port.read(8, NOW), Ok(0), "pulled down");
    assert_eq!(port.take_contention(), 0);
}

#[test]
fn outputs_show_and_edges_are_stamped() {
    let mut port = Gpio::default();
    port.watch(8);
    port.write(4, 0x4444_4443, Time::from_us(1)).unwrap();
    port.write(0x10, 1 << 8, Time::from_us(2)).unwrap();
    port.write(0x10, 1 << 24, Time::from_us(3)).unwrap();
    port.write(0x10, 1 << 24 | 1 << 8, Time::from_us(4))
        .unwrap();
    assert_eq!(
        port.edges(8),
        [
            (Time::from_us(2), true),
            (Time::from_us(3), false),
            (Time::from_us(4), true)
        ]
    );
    port.drive(8, Drive::Low, Time::from_us(5));
    assert_eq!(port.take_contention(), 1 << 8);
    assert_eq!(port.level() & 1 << 8, 0);
}

#[test]
fn open_drain_only_pulls_down_and_analog_reads_zero() {
    let mut port = Gpio::default();
    port.write(0, 0x4444_4407, NOW).unwrap();
    port.write(0x0C, 1, NOW).unwrap();
    assert_eq!(port.level() & 1, 0, "released, nothing pulls it up");
    port.drive(0, Drive::PullUp, NOW);
    assert_eq!(port.level() & 1, 1);
    port.drive(1, Drive::Millivolts(3000), NOW);
    assert_eq!(port.level() & 2, 2);
    assert_eq!(port.read(8, NOW), Ok(1), "pin 1 is analog");
    assert_eq!(port.millivolts(1), 3000);
}

#[test]
fn a_locked_pin_keeps_its_mode() {
    let mut port = Gpio::default();
    for value in [0x1_0001, 0x0001, 0x1_0001] {
        port.write(0x18, value, NOW).unwrap();
    }
    port.read(0x18, NOW).unwrap();
    assert_eq!(port.read(0x18, NOW), Ok(0x1_0001));
    port.write(0, 0x3333_3333, NOW).unwrap();
    assert_eq!(port.read(0, NOW), Ok(0x3333_3334));
}

#[test]
fn slow_pin_faster_than_2_mhz_is_refused() {
    let mut port = Gpio::with_slow_pins(1 << 13);
    for (mode, allowed) in [(0x2, true), (0x1, false), (0x3, false), (0x4, true)] {
        let written = port.write(4, 0x4404_4444 | mode << 20, NOW);
        assert_eq!(written.is_ok(), allowed, "{mode}");
    }
    assert_eq!(port.write(4, 0x4444_4443, NOW), Ok(()), "another pin");
}

#[test]
fn debug_port_owns_its_pins_whatever_the_registers_say() {
    let mut port = Gpio::default();
    let swj = DebugPins {
        owned: 0b111 << 13,
        up: 0b101 << 13,
        down: 1 << 14,
    };
    port.set_debug(swj, NOW);
    assert_eq!(port.read(8, NOW), Ok(0b101 << 13));
    // The board's pull-up wins against the weak pull-down of SWCLK.
    port.drive(14, Drive::PullUp, NOW);
    assert_eq!(port.read(8, NOW), Ok(0b111 << 13));
    // Outputs, low.
    port.write(4, 0x2224_4444, NOW).unwrap();
    assert_eq!((port.outputs(), port.level()), (0, 0b111 << 13));
    assert_eq!(port.held(14), Some(false));
    port.set_debug(DebugPins::default(), NOW);
    assert_eq!((port.outputs(), port.level()), (0b111 << 13, 0));
    port.set_debug(swj, NOW);
    port.reset(NOW);
    assert_eq!(port.level(), 0b111 << 13);
}

#[test]
fn output_of_the_dac_is_at_an_analog_pin_only() {
    let mut port = Gpio::default();
    port.set_dac(4, Some(1200));
    assert_eq!(port.dac(4), None);
    port.write(0, 0x4440_4444, NOW).unwrap();
    assert_eq!(port.dac(4), Some(1200));
    assert_eq!(port.dac(5), None);
}
