//! The DIP switch SW01.

use sim::line::{Format, Settings};
use sim::{Config, Module, Time};

use crate::rig::{FIRST, Rig, START, config, symbol};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_unit_answers_only_to_its_own_address() {
    for dip in [1, 2, 17, 64, 128, 170, 247] {
        let mut rig = Rig::new(Module::Di4, dip);
        rig.assert_answers(dip);
        for other in [dip ^ 1, 248, 254, 255].into_iter().filter(|&o| o != 0) {
            assert_eq!(
                rig.ask(other, &[1, 0, FIRST, 0, 4]),
                None,
                "switch {dip} answers unit {other}"
            );
            assert_eq!(rig.ask(other, &[0x55]), None);
        }
        assert!(!rig.board.leds().fault);
        rig.assert_answers(dip);
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn unit_without_an_address_does_not_answer_and_blinks() {
    for dip in [0, 248, 251] {
        let mut rig = Rig::new(Module::Do4, dip);
        for unit in [0, 1, dip, 255] {
            assert_eq!(
                rig.ask(unit, &[1, 0, FIRST, 0, 4]),
                None,
                "switch {dip} answers unit {unit}"
            );
        }
        rig.board.watch_pin('B', 9);
        let from = rig.board.now();
        rig.board.run_for(Time::from_secs(2));
        let edges = rig.board.pin_edges('B', 9);
        assert!(
            (8..=12).contains(&edges.len()),
            "switch {dip}: LED edges {edges:?}"
        );
        assert!(edges.iter().all(|(at, _)| *at > from));
        assert_eq!(rig.board.line().driver_edges().count(), 0);
        let log = rig.board.take_log();
        assert!(log.contains("no unit address"), "{log}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn switch_254_without_another_image_starts_the_one_there_is_as_unit_255() {
    let mut rig = Rig::new(Module::Di4, 254);
    rig.assert_answers(255);
    for unit in [1, 254] {
        assert_eq!(rig.ask(unit, &[1, 0, FIRST, 0, 4]), None, "unit {unit}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn switch_that_bounces_at_power_on_is_read_once_it_is_stable() {
    let mut rig = Rig::cold(Config {
        dip: 17,
        ..config(Module::Di4, &[])
    });
    for (until_ms, dip) in [(4, 17), (9, 19), (10, 17), (12, 19), (15, 17), (18, 16)] {
        rig.board.set_dip(dip);
        rig.board.run_until(Time::from_ms(until_ms));
    }
    rig.board.set_dip(17);
    rig.board.run_until(START);
    rig.assert_answers(17);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn switch_that_never_is_stable_does_not_keep_the_unit_from_starting() {
    let mut rig = Rig::cold(Config {
        dip: 17,
        ..config(Module::Di4, &[])
    });
    while rig.board.now() < START {
        let even = (rig.board.now().as_us() / 2_000).is_multiple_of(2);
        rig.board.set_dip(if even { 19 } else { 17 });
        rig.board.run_for(Time::from_us(500));
    }
    let log = rig.board.take_log();
    assert!(log.contains("unit address 1"), "{log}");
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn reset_of_any_kind_keeps_the_address_of_power_on() {
    let mut rig = Rig::new(Module::Di4, 17);
    rig.tolerant = true;
    rig.board.set_dip(18);
    // By software: COMMAND 2.
    rig.ask(17, &[6, 1, 0, 0x5A, 0x17]).unwrap();
    rig.ask(17, &[6, 1, 8, 0, 2]).unwrap();
    rig.started();
    assert_eq!(rig.board.resets(), 1);
    rig.assert_answers(17);
    // By the reset pin.
    rig.board.reset();
    rig.started();
    assert_eq!(rig.board.resets(), 2);
    rig.assert_answers(17);
    // By the watchdog: the scan hangs.
    let scan = symbol("EXTI1") & !1;
    let was = rig.board.patch_code(scan, &[0xFE, 0xE7]).unwrap();
    while rig.board.resets() == 2 {
        rig.board.run_for(Time::from_ms(1));
    }
    rig.board.patch_code(scan, &was).unwrap();
    rig.started();
    rig.assert_answers(17);
    assert_eq!(rig.ask(18, &[1, 0, FIRST, 0, 4]), None);
    rig.board.cycle();
    rig.started();
    rig.assert_answers(18);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn all_switches_on_selects_the_default_line_settings_with_any_stored_settings() {
    let mut rig = Rig::set_up(Module::Di4, &[(0x0101, 9216), (0x0102, 2), (0x0105, 1000)]);
    rig.patience = Time::from_ms(1002);
    assert_eq!(rig.register(0x0101), 9216);
    rig.board.set_dip(255);
    rig.power_cycle();
    rig.settings(Settings::default());
    rig.patience = Time::ZERO;
    assert!(!rig.board.leds().fault);
    assert_eq!(rig.ask(1, &[1, 0, FIRST, 0, 4]), None);
    let reply = rig.ask(255, &[3, 1, 1, 0, 2]).expect("the unit answers");
    assert_eq!(reply, [3, 4, 0x24, 0, 0, 2], "the stored values are read");
    // Correct the stored values.
    rig.ask(255, &[6, 1, 0, 0x5A, 0x17]).unwrap();
    rig.ask(255, &[16, 1, 1, 0, 2, 4, 0, 192, 0, 1]).unwrap();
    rig.ask(255, &[6, 1, 8, 0, 1]).unwrap();
    rig.board.run_for(Time::from_ms(100));
    rig.board.set_dip(1);
    rig.power_cycle();
    rig.settings(Settings {
        baud: 19_200,
        format: Format::E1,
    });
    rig.patience = Time::from_ms(1002);
    rig.assert_answers(1);
}
