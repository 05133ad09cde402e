//! `modio-hil` against the image in the simulator: boards on one line, a pseudo-terminal, and wires from outputs to
//! inputs through the simulator's HTTP interface. Every check of wires, pulses, analog values and power passes on a
//! right bench; the checks of wires and power fail on a wrong one.

#![cfg(target_os = "linux")]

#[path = "virtual_bench/mod.rs"]
mod virtual_bench;

use virtual_bench::{Bench, Loop, Run};

const WIRES: &str = r#"
[[wire]]
from = { unit = 1, point = 0x0010 }
to = { unit = 2, point = 0x0010 }
within_ms = 5000
pulses = 5

[[wire]]
from = { unit = 1, point = 0x0011 }
to = { unit = 2, point = 0x0011 }
within_ms = 5000
"#;

const ANALOG: &str = r#"
module = "2ai2ao"

[[analog]]
from = { point = 0x0012 }
to = { point = 0x0010 }
tolerance = 20
within_ms = 2000

[[analog]]
from = { point = 0x0013 }
to = { point = 0x0011 }
tolerance = 20
within_ms = 2000
"#;

/// The options to test only the wires. The simulator may be slow on a busy machine, so the tests wait long for a reply.
const ONLY_WIRES: [&str; 5] = ["--no-suite", "--requests", "0", "--patience", "2000"];

/// The tests outside the suite: their kind and their verdict.
fn verdicts(run: &Run) -> Vec<(&str, &str)> {
    let findings = run.report["hil"].as_array().map_or(&[][..], Vec::as_slice);
    findings
        .iter()
        .map(|finding| {
            let name = finding["name"].as_str().unwrap_or_default();
            let kind = name.split('/').next().unwrap_or_default();
            (kind, finding["result"].as_str().unwrap_or_default())
        })
        .collect()
}

/// Runs modio-hil on the wires of the bench file, which must give these verdicts.
fn assert_wires(bench: &Bench, file: &str, wanted: &[(&str, &str)]) -> Run {
    let run = bench.hil_until(file, &ONLY_WIRES, |run| verdicts(run) == wanted);
    assert_eq!(verdicts(&run), wanted, "{}", run.text);
    let failed = wanted.iter().any(|(_, result)| *result == "failed");
    assert_eq!(run.status, Some(i32::from(failed)), "{}", run.text);
    run
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn wires_and_pulses_between_two_boards_pass_and_a_missing_or_crossed_wire_fails() {
    let bench = Bench::new(&[(1, "4do"), (2, "4di")]);
    bench.wire([Loop::digital(1, 1, 2, 1), Loop::digital(1, 2, 2, 2)]);
    let [wire, pulses] = [("wires", "passed"), ("pulses", "passed")];
    assert_wires(&bench, WIRES, &[wire, pulses, wire]);

    bench.wire([Loop::digital(1, 1, 2, 1)]);
    assert_wires(&bench, WIRES, &[wire, pulses, ("wires", "failed")]);

    // The second input follows the first output as well.
    bench.wire([Loop::digital(1, 1, 2, 1), Loop::digital(1, 1, 2, 2)]);
    let failed = ("wires", "failed");
    assert_wires(&bench, WIRES, &[failed, pulses, failed]);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn analog_wires_of_one_board_pass_and_a_wrong_gain_fails() {
    let bench = Bench::new(&[(1, "2ai2ao")]);
    bench.wire([Loop::analog(3, 1, 1.0), Loop::analog(4, 2, 1.0)]);
    let run = assert_wires(&bench, ANALOG, &[("analog", "passed"); 2]);
    let unit = &run.report["about"]["unit"];
    assert_eq!(unit["module"], "2ai2ao");
    assert_eq!(unit["firmware"], env!("CARGO_PKG_VERSION"));
    assert_eq!(unit["identity"].as_str().map(str::len), Some(24));
    assert!(run.report["about"]["adapter"].is_null(), "{}", run.report);

    // 1 % of 4095 is 41 codes, the tolerance 20.
    bench.wire([Loop::analog(3, 1, 1.0), Loop::analog(4, 2, 0.99)]);
    let wanted = [("analog", "passed"), ("analog", "failed")];
    assert_wires(&bench, ANALOG, &wanted);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn case_that_needs_power_is_skipped_without_a_command_passes_with_one_and_fails_with_a_wrong_one() {
    let bench = Bench::new(&[(1, "4do")]);
    let only = "outputs/start-value";
    let case = ["--only", only, "--requests", "0", "--patience", "1000"];
    let assert_ends = |file: &str, status: i32, wanted: &str| {
        let ends = |run: &Run| {
            let result = &run.report["suite"]["cases"][0]["result"];
            run.status == Some(status) && result == wanted
        };
        let run = bench.hil_until(file, &case, ends);
        assert!(ends(&run), "{}", run.text);
    };
    assert_ends("", 0, "skipped");
    assert_ends(
        &format!("power_cmd = {:?}", bench.power_command()),
        0,
        "passed",
    );
    assert_ends("power_cmd = 'true'", 1, "failed");
    let other = |run: &Run| run.status == Some(2) && run.text.contains("but the bench has 4di");
    let run = bench.hil_until("module = '4di'", &case, other);
    assert!(other(&run), "{}", run.text);
}
