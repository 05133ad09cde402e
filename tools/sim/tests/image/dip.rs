//! The DIP switch SW01.

use sim::line::{Format, Settings};
use sim::{Config, Module, Time};

use crate::bench::{Bench, FIRST, START, config, symbol};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_unit_answers_only_to_its_own_address() {
    for dip in [1, 2, 17, 64, 128, 170, 247] {
        let mut bench = Bench::new(Module::Di4, dip);
        bench.assert_answers(dip);
        for other in [dip ^ 1, 248, 254, 255].into_iter().filter(|&o| o != 0) {
            assert_eq!(
                bench.ask(other, &[1, 0, FIRST, 0, 4]),
                None,
                "switch {dip} answers unit {other}"
            );
            assert_eq!(bench.ask(other, &[0x55]), None);
        }
        assert!(!bench.board.leds().fault);
        bench.assert_answers(dip);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn unit_without_an_address_does_not_answer_and_blinks() {
    for dip in [0, 248, 251] {
        let mut bench = Bench::new(Module::Do4, dip);
        for unit in [0, 1, dip, 255] {
            assert_eq!(
                bench.ask(unit, &[1, 0, FIRST, 0, 4]),
                None,
                "switch {dip} answers unit {unit}"
            );
        }
        bench.board.watch_pin('B', 9);
        let from = bench.board.now();
        bench.board.run_for(Time::from_secs(2));
        let edges = bench.board.pin_edges('B', 9);
        assert!(
            (8..=12).contains(&edges.len()),
            "switch {dip}: LED edges {edges:?}"
        );
        assert!(edges.iter().all(|(at, _)| *at > from));
        assert_eq!(bench.board.line().driver_edges().count(), 0);
        let log = bench.board.take_log();
        assert!(log.contains("no unit address"), "{log}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn switch_254_without_another_image_starts_the_one_there_is_as_unit_255() {
    let mut bench = Bench::new(Module::Di4, 254);
    bench.assert_answers(255);
    for unit in [1, 254] {
        assert_eq!(bench.ask(unit, &[1, 0, FIRST, 0, 4]), None, "unit {unit}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn switch_that_bounces_at_power_on_is_read_once_it_is_stable() {
    let mut bench = Bench::cold(Config {
        dip: 17,
        ..config(Module::Di4, &[])
    });
    for (until_ms, dip) in [(4, 17), (9, 19), (10, 17), (12, 19), (15, 17), (18, 16)] {
        bench.board.set_dip(dip);
        bench.board.run_until(Time::from_ms(until_ms));
    }
    bench.board.set_dip(17);
    bench.board.run_until(START);
    bench.assert_answers(17);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn switch_that_never_is_stable_does_not_keep_the_unit_from_starting() {
    let mut bench = Bench::cold(Config {
        dip: 17,
        ..config(Module::Di4, &[])
    });
    while bench.board.now() < START {
        let even = (bench.board.now().as_us() / 2_000).is_multiple_of(2);
        bench.board.set_dip(if even { 19 } else { 17 });
        bench.board.run_for(Time::from_us(500));
    }
    let log = bench.board.take_log();
    assert!(log.contains("unit address 1"), "{log}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn reset_of_any_kind_keeps_the_address_of_power_on() {
    let mut bench = Bench::new(Module::Di4, 17);
    bench.tolerant = true;
    bench.board.set_dip(18);
    // By software: COMMAND 2.
    bench.ask(17, &[6, 1, 0, 0x5A, 0x17]).unwrap();
    bench.ask(17, &[6, 1, 8, 0, 2]).unwrap();
    bench.started();
    assert_eq!(bench.board.resets(), 1);
    bench.assert_answers(17);
    // By the reset pin.
    bench.board.reset();
    bench.started();
    assert_eq!(bench.board.resets(), 2);
    bench.assert_answers(17);
    // By the watchdog: the scan hangs.
    let scan = symbol("EXTI1") & !1;
    let was = bench.board.patch_code(scan, &[0xFE, 0xE7]).unwrap();
    while bench.board.resets() == 2 {
        bench.board.run_for(Time::from_ms(1));
    }
    bench.board.patch_code(scan, &was).unwrap();
    bench.started();
    bench.assert_answers(17);
    assert_eq!(bench.ask(18, &[1, 0, FIRST, 0, 4]), None);
    bench.board.cycle();
    bench.started();
    bench.assert_answers(18);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn all_switches_on_selects_the_default_line_settings_with_any_stored_settings() {
    let mut bench = Bench::set_up(Module::Di4, &[(0x0101, 9216), (0x0102, 2), (0x0105, 1000)]);
    bench.patience = Time::from_ms(1002);
    assert_eq!(bench.register(0x0101), 9216);
    bench.board.set_dip(255);
    bench.power_cycle();
    bench.settings(Settings::default());
    bench.patience = Time::ZERO;
    assert!(!bench.board.leds().fault);
    assert_eq!(bench.ask(1, &[1, 0, FIRST, 0, 4]), None);
    let reply = bench.ask(255, &[3, 1, 1, 0, 2]).expect("the unit answers");
    assert_eq!(reply, [3, 4, 0x24, 0, 0, 2], "the stored values are read");
    // Correct the stored values.
    bench.ask(255, &[6, 1, 0, 0x5A, 0x17]).unwrap();
    bench.ask(255, &[16, 1, 1, 0, 2, 4, 0, 192, 0, 1]).unwrap();
    bench.ask(255, &[6, 1, 8, 0, 1]).unwrap();
    bench.board.run_for(Time::from_ms(100));
    bench.board.set_dip(1);
    bench.power_cycle();
    bench.settings(Settings {
        baud: 19_200,
        format: Format::E1,
    });
    bench.patience = Time::from_ms(1002);
    bench.assert_answers(1);
}
