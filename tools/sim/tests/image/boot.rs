//! Starting up.

use sim::{Config, Module, Time};

use crate::bench::{Bench, flash_with};

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_log_says_what_the_device_is() {
    let mut bench = Bench::new(Module::Do4, 17);
    let log = bench.board.take_log();
    for line in [
        "modio ",
        "9600 8N2",
        "reset: power-on",
        "unit address 17",
        "slot 5: 4do",
    ] {
        assert!(log.contains(line), "{line:?} in:\n{log}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn it_answers_within_a_hundred_milliseconds_of_power_on() {
    let mut bench = Bench::cold(Config {
        flash: Some(flash_with(Module::Di4)),
        ..Config::default()
    });
    bench.board.run_for(Time::from_ms(80));
    bench.assert_answers(1);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn without_a_crystal_it_runs_on_the_internal_oscillator_and_says_so() {
    let mut bench = Bench::with(Config {
        crystal: false,
        flash: Some(flash_with(Module::Di4)),
        ..Config::default()
    });
    bench.board.run_for(Time::from_ms(500));
    bench.assert_answers(1);
    let log = bench.board.take_log();
    assert!(log.contains("crystal did not start"), "{log}");
    bench.board.watch_pin('B', 9);
    bench.board.run_for(Time::from_secs(4));
    assert_eq!(
        bench.board.pin_edges('B', 9).len(),
        4,
        "a flash every two seconds"
    );
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_run_led_blinks_and_the_watchdog_is_content() {
    let mut bench = Bench::new(Module::Di4, 1);
    bench.board.watch_pin('C', 13);
    bench.board.run_for(Time::from_secs(10));
    let edges = bench.board.pin_edges('C', 13).len();
    assert!((19..=21).contains(&edges), "{edges} edges in ten seconds");
    assert_eq!(bench.board.resets(), 0);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn a_request_lights_the_activity_led() {
    let mut bench = Bench::new(Module::Di4, 1);
    bench.board.run_for(Time::from_ms(200));
    assert!(!bench.board.leds().activity);
    // Another's request is no activity.
    bench.ask(2, &[1, 0, 0x10, 0, 4]);
    assert!(!bench.board.leds().activity);
    bench.assert_answers(1);
    assert!(bench.board.leds().activity);
    bench.board.run_for(Time::from_ms(200));
    assert!(!bench.board.leds().activity);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_same_inputs_give_the_same_run_to_the_instruction() {
    let run = || {
        let mut bench = Bench::new(Module::Do4, 1);
        bench.ask(1, &[0x0F, 0, 0x10, 0, 4, 1, 0x05]).unwrap();
        bench.ask(1, &[1, 0, 0x10, 0, 4]).unwrap();
        bench.board.run_for(Time::from_us(12_345));
        let ram = bench.board.ram().to_vec();
        (
            bench.board.instructions(),
            bench.board.now(),
            bench.board.pc(),
            ram,
        )
    };
    assert!(run() == run());
}
