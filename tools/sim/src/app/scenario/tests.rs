//! Tests of scenarios on boards whose firmware does nothing.

use register_map::Module;
use sim::radio::Parameters;
use sim::{Channel, Config};

use super::*;
use crate::app::scene::Scene;
use crate::app::testing::{bench_of, bench_of_boards, scene};

fn play(scene: &mut Scene, text: &str) {
    scene.scenario = Scenario::parse(text, &scene.known()).unwrap();
}

fn energised(scene: &Scene, board: usize, channel: usize) -> bool {
    match scene.bus.board(board).channel(channel) {
        Channel::Di { energised } => energised,
        other => panic!("{other:?}"),
    }
}

#[test]
fn steps_happen_in_time_order_not_in_file_order() {
    let mut scene = scene(Module::Di4);
    play(
        &mut scene,
        r#"
        [[step]]
        at = "20ms"
        channel = 1
        energised = false
        [[step]]
        at = "10ms"
        channel = 1
        energised = true
        [[step]]
        at = "10ms"
        dip = 9
        "#,
    );
    let ms = Time::from_ms;
    scene.run_until(ms(10) - Time::from_us(1));
    assert!(!energised(&scene, 0, 1));
    assert_eq!(scene.scenario.next(), Some(ms(10)));
    scene.run_until(ms(10) + Time::from_us(1));
    assert!(energised(&scene, 0, 1));
    assert_eq!(scene.bus.board(0).dip(), 9);
    scene.run_until(ms(20) + Time::from_us(1));
    assert!(!energised(&scene, 0, 1));
    assert_eq!(scene.scenario.next(), None);
}

#[test]
fn ramp_starts_at_the_present_voltage_and_repeats_in_every_round() {
    let mut scene = scene(Module::Ai4);
    let millivolts = |scene: &Scene| match scene.bus.board(0).channel(2) {
        Channel::Ai { millivolts } => millivolts,
        other => panic!("{other:?}"),
    };
    play(
        &mut scene,
        r#"
        repeat = "300ms"
        [[step]]
        channel = 2
        millivolts = 1000
        [[step]]
        at = "100ms"
        channel = 2
        millivolts = 2000
        over = "100ms"
        "#,
    );
    let mut seen = Vec::new();
    for ms in [1, 101, 125, 151, 199, 201, 299, 301, 451, 501] {
        scene.run_until(Time::from_ms(ms));
        seen.push(millivolts(&scene));
    }
    let expected = [1000, 1000, 1200, 1500, 1900, 2000, 2000, 1000, 1500, 2000];
    assert_eq!(seen, expected);
}

#[test]
fn steps_with_a_board_name_change_that_board_only() {
    let config = |module| Config {
        module,
        ..Config::default()
    };
    let mut scene = bench_of_boards([("a", config(Module::Di4)), ("b", config(Module::Di4))]);
    play(
        &mut scene,
        r#"
        [[step]]
        at = "10ms"
        board = "b"
        power = "off"
        [[step]]
        at = "20ms"
        board = "b"
        module = "4ai"
        [[step]]
        at = "20ms"
        board = "a"
        module = "4ai"
        [[step]]
        at = "30ms"
        board = "b"
        power = "on"
        [[step]]
        at = "40ms"
        power = "cycle"
        [[step]]
        at = "50ms"
        board = "b"
        faults = { hse_failed = true, noise_hz = 5.0 }
        "#,
    );
    let powered = |scene: &Scene| [0, 1].map(|n| scene.bus.board(n).powered());
    let mut seen = Vec::new();
    for ms in [5, 15, 35, 45, 145] {
        scene.run_until(Time::from_ms(ms));
        seen.push(powered(&scene));
    }
    let on = [true, true];
    assert_eq!(seen, [on, [true, false], on, [false, true], on]);
    let modules = [0, 1].map(|n| scene.bus.board(n).module());
    assert_eq!(
        modules,
        [Module::Di4, Module::Ai4],
        "changing the module of board a is refused, because its power is on"
    );
    assert!(scene.bus.board(0).crystal() && !scene.bus.board(1).crystal());
    assert!((scene.disturbance.noise_hz() - 5.0).abs() < 1e-9);
}

#[test]
fn step_sets_the_loss_of_radio_packets() {
    let mut scene = bench_of(Config {
        radio: Some(Parameters::FACTORY),
        ..Config::default()
    });
    play(
        &mut scene,
        r#"
        [[step]]
        at = "10ms"
        faults = { radio_loss = 0.5 }
        "#,
    );
    let mut seen = Vec::new();
    for ms in [9, 11] {
        scene.run_until(Time::from_ms(ms));
        seen.extend(scene.bus.air().map(|air| air.loss()));
    }
    assert_eq!(seen, [0.0, 0.5]);
}

#[test]
fn scenario_error_is_one_line_that_names_the_line_or_the_step() {
    let scene = scene(Module::Di4);
    for (text, part) in [
        ("", "no [[step]]"),
        ("[[step]]\nat = 5", "line 2"),
        ("[[step]]\nat = 'soon'\ndip = 1", "line 2: \"soon\""),
        ("[[step]]\nat = '1000days'\ndip = 1", "100 days"),
        ("[[step]]\nat = '1s'", "step 1: a step needs exactly one of"),
        (
            "[[step]]\nat = '1s'\ndip = 1\npower = 'on'",
            "step 1: a step needs exactly one of",
        ),
        ("[[step]]\nat = '1s'\npower = 'up'", "line 3"),
        (
            "[[step]]\nat = '1s'\nenergised = true",
            "`channel` is needed",
        ),
        (
            "[[step]]\nat = '1s'\ndip = 1\nchannel = 1",
            "`channel` is needed",
        ),
        ("[[step]]\nat = '1s'\nchannel = 5\nmanual = true", "1 to 4"),
        (
            "[[step]]\nat = '1s'\nchannel = 1\nmillivolts = 3301",
            "0 to 3300",
        ),
        (
            "[[step]]\nat = '1s'\nchannel = 1\nmanual = true\nover = '1s'",
            "`over`",
        ),
        ("[[step]]\nat = '1s'\nslot = 5\ndip = 1", "`slot` can stand"),
        (
            "[[step]]\nat = '1s'\nslot = 3\nmodule = '4do'",
            "no slot at port 3",
        ),
        ("[[step]]\nat = '1s'\nmodule = '8do'", "step 1: '8do' is"),
        ("[[step]]\nat = '1s'\nboard = 'x'\ndip = 1", "name 'x'"),
        ("[[step]]\nat = '1s'\nfaults = {}", "names no fault"),
        (
            "[[step]]\nat = '1s'\nfaults = { drop_rate = 2.0 }",
            "from 0 to 1",
        ),
        (
            "[[step]]\nat = '1s'\nfaults = { radio_loss = 2.0 }",
            "`radio_loss` must be",
        ),
        ("[[step]]\nat = '1s'\nfaults = { smoke = true }", "line 3"),
        ("[[step]]\nchannel = 1\nenergised = 'off'", "line 3"),
        ("[[step]]\nchannel = 1\nenergised = 1", "line 3"),
        ("[[step]]\nchannel = 1\nmillivolts = 7.0", "line 3"),
        ("[[step]]\nchannel = 1\nmillivolts = -7", "line 3"),
        ("[[step]]\nchannel = 1\nmillivolts = 65543", "line 3"),
        ("[[step]]\nchannel = '1'\nmillivolts = 7", "line 2"),
        ("[[step]]\ndip = 1\ndip = 2", "line 3"),
        ("[[step]]\ndip = 256", "line 2"),
        ("[[step]]\ndip = '1'", "line 2"),
        ("[[step]]\npower = true", "line 2"),
        ("[[step]]\nmodule = 4", "line 2"),
        ("[[step]]\ndip = 1\ncolour = 1", "line 3"),
        ("[[step]]\nfaults = { drop_rate = nan }", "from 0 to 1"),
        ("[[step]]\nfaults = { noise_hz = inf }", "from 0 to 10000"),
        ("[[step]]\nfaults = { hse_failed = 1 }", "line 2"),
        ("repeat = '1s'\n[[step]]\nat = '2s'\ndip = 1", "`repeat`"),
        ("repeat = '1ns'\n[[step]]\nat = '0s'\ndip = 1", "`repeat`"),
    ] {
        let what = Scenario::parse(text, &scene.known()).unwrap_err();
        assert!(what.contains(part), "{text:?}: {what}");
        assert!(!what.contains('\n'), "{what:?}");
    }
}
