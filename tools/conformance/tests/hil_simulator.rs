//! `modio-hil` against the image in the simulator: each board a `modio-sim` with its line on a pseudo-terminal, the
//! lines joined to one, and wires from outputs to inputs through the simulators' HTTP interface. Every check of
//! wires, pulses, analog values and power passes on a bench that is right, and fails on one that is not.

#![cfg(target_os = "linux")]

#[path = "virtual_bench/mod.rs"]
mod virtual_bench;

use std::fs;

use serde_json::Value;
use virtual_bench::{Bench, Loop};

const WIRES: &str = r#"
[[wire]]
from = { unit = 1, point = 0x0010 }
to = { unit = 2, point = 0x0010 }
within_ms = 2000
pulses = 5

[[wire]]
from = { unit = 1, point = 0x0011 }
to = { unit = 2, point = 0x0011 }
within_ms = 2000
"#;

const ANALOG: &str = r#"
module = "2ai2ao"

[[analog]]
from = { point = 0x0012 }
to = { point = 0x0010 }
tolerance = 20
within_ms = 400

[[analog]]
from = { point = 0x0013 }
to = { point = 0x0011 }
tolerance = 20
within_ms = 400
"#;

/// The verdicts of what was tried beside the suite: its name up to the first unit, and how it ended.
fn verdicts(report: &Value) -> Vec<(String, String)> {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let findings = report["hil"].as_array().expect("the findings are a list");
    findings
        .iter()
        .map(|finding| {
            let name = text(&finding["name"]);
            let kind = name.split('/').next().unwrap_or_default().to_owned();
            (kind, text(&finding["result"]))
        })
        .collect()
}

fn ended(verdicts: &[(String, String)]) -> Vec<(&str, &str)> {
    verdicts
        .iter()
        .map(|(kind, result)| (kind.as_str(), result.as_str()))
        .collect()
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn wires_and_pulses_between_two_boards_pass_and_a_wire_that_is_missing_fails() {
    let bench = Bench::new(&[(1, "4do"), (2, "4di")]);
    bench.wire([Loop::digital(1, 1, 2, 1), Loop::digital(1, 2, 2, 2)]);
    let only_wires = ["--no-suite", "--requests", "0"];
    let run = bench.hil(WIRES, &only_wires);
    assert_eq!(run.status, Some(0), "{}", run.text);
    let found = verdicts(&run.report);
    assert_eq!(
        ended(&found),
        [
            ("wires", "passed"),
            ("pulses", "passed"),
            ("wires", "passed")
        ],
        "{}",
        run.text
    );

    bench.wire([Loop::digital(1, 1, 2, 1)]);
    let run = bench.hil(WIRES, &only_wires);
    assert_eq!(run.status, Some(1), "{}", run.text);
    let found = verdicts(&run.report);
    assert_eq!(ended(&found)[2], ("wires", "failed"), "{}", run.text);

    // The second input sees the pulses of the first output, which its own output does not send.
    bench.wire([Loop::digital(1, 1, 2, 1), Loop::digital(1, 1, 2, 2)]);
    let run = bench.hil(WIRES, &only_wires);
    let found = verdicts(&run.report);
    assert_eq!(ended(&found)[0], ("wires", "failed"), "{}", run.text);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn pulses_of_a_contact_that_bounces_longer_than_the_debounce_fail() {
    let bench = Bench::new(&[(1, "4do"), (2, "4di")]);
    bench.wire([Loop::bouncing(1, 1, 2, 1), Loop::digital(1, 2, 2, 2)]);
    let run = bench.hil(WIRES, &["--no-suite", "--requests", "0"]);
    let found = verdicts(&run.report);
    assert_eq!(run.status, Some(1), "{}", run.text);
    let wanted = [
        ("wires", "passed"),
        ("pulses", "failed"),
        ("wires", "passed"),
    ];
    assert_eq!(ended(&found), wanted, "{}", run.text);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn analog_wires_of_one_board_pass_and_a_gain_that_is_off_fails() {
    let bench = Bench::new(&[(1, "2ai2ao")]);
    bench.wire([Loop::analog(3, 1, 1.0), Loop::analog(4, 2, 1.0)]);
    let only_wires = ["--no-suite", "--requests", "0"];
    let run = bench.hil(ANALOG, &only_wires);
    assert_eq!(run.status, Some(0), "{}", run.text);
    let found = verdicts(&run.report);
    assert_eq!(ended(&found), [("analog", "passed"); 2], "{}", run.text);
    let unit = &run.report["about"]["unit"];
    assert_eq!(unit["module"], "2ai2ao");
    assert_eq!(unit["firmware"], env!("CARGO_PKG_VERSION"));
    assert_eq!(unit["identity"].as_str().map(str::len), Some(24));
    assert!(run.report["about"]["adapter"].is_null(), "{}", run.report);

    // 1 % of 4095 is 41 codes, the tolerance 20.
    bench.wire([Loop::analog(3, 1, 1.0), Loop::analog(4, 2, 0.99)]);
    let run = bench.hil(ANALOG, &only_wires);
    let found = verdicts(&run.report);
    assert_eq!(run.status, Some(1), "{}", run.text);
    assert_eq!(
        ended(&found),
        [("analog", "passed"), ("analog", "failed")],
        "{}",
        run.text
    );
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn case_that_needs_power_is_skipped_without_a_command_passes_with_one_and_fails_with_a_wrong_one() {
    let bench = Bench::new(&[(1, "4do")]);
    let case = ["--only", "outputs/start-value", "--requests", "0"];
    let result = |run: &virtual_bench::Run| {
        let case = &run.report["suite"]["cases"][0];
        (
            run.status,
            case["result"].as_str().unwrap_or_default().to_owned(),
        )
    };
    let run = bench.hil("", &case);
    assert_eq!(
        result(&run),
        (Some(0), "skipped".to_owned()),
        "{}",
        run.text
    );
    let run = bench.hil(&format!("power_cmd = {:?}", bench.power_command()), &case);
    assert_eq!(result(&run), (Some(0), "passed".to_owned()), "{}", run.text);
    let run = bench.hil("power_cmd = 'true'", &case);
    assert_eq!(result(&run), (Some(1), "failed".to_owned()), "{}", run.text);
    let run = bench.hil("module = '4di'", &case);
    assert!(run.text.contains("but the bench has 4di"), "{}", run.text);
    assert_eq!(run.status, Some(2));
    assert!(fs::exists(bench.port()).expect("the port can be looked for"));
}
