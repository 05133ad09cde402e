//! Wires, pulses and analog values on fake units: the verdicts, and that outputs are restored.

use std::sync::Arc;

use super::bench_file::BenchFile;
use super::fake::{Fate, Line};
use super::tests::{has, never, plan, run_plan};
use super::*;

fn wired(text: &str) -> (Line, Plan) {
    let mut line = Line::new(&[1, 2]);
    line.wires = (0..2).map(|n| [(1, 16 + n), (2, 16 + n)]).collect();
    line.units[0].bits[16] = true;
    let file = BenchFile::parse(text, None).unwrap();
    let plan = Plan {
        wires: file.wires(),
        analog: file.analog(),
        ..plan(&line)
    };
    (line, plan)
}

const WIRES: &str = "[[wire]]\nfrom = { point = 16 }\nto = { unit = 2, point = 16 }\n\
                     [[wire]]\nfrom = { point = 17 }\nto = { unit = 2, point = 17 }\n";

/// Returns the findings that failed. The outputs must have their values of before.
fn failing((mut line, plan): (Line, Plan)) -> Vec<String> {
    let outputs = |line: &Line| {
        let unit = &line.units[0];
        let analog = (18..20).map(|point| unit.registers.get(&point).copied().unwrap_or_default());
        (unit.bits[16..18].to_vec(), analog.collect::<Vec<_>>())
    };
    let before = outputs(&line);
    let (report, ended) = run_plan(&mut line, &plan, &never());
    assert_eq!(ended, Ok(()));
    assert_eq!(outputs(&line), before, "put back");
    let findings = report.findings.iter();
    let failed = findings.filter(|finding| finding.verdict != Verdict::Passed);
    failed.map(ToString::to_string).collect()
}

#[test]
fn wires_as_described_pass_and_outputs_are_restored() {
    let (mut line, plan) = wired(WIRES);
    let (report, ended) = run_plan(&mut line, &plan, &never());
    assert_eq!(ended, Ok(()));
    assert_eq!(report.totals().passed, 2, "{:?}", report.findings);
    assert!(report.findings[0].note.starts_with("on after "));
    assert_eq!(line.units[0].bits[16..18], [true, false]);
}

#[test]
fn wrong_wires_fail_each_with_its_reason() {
    let (mut line, plan) = wired(WIRES);
    line.wires.pop();
    let [broken] = &failing((line, plan))[..] else {
        panic!("one wire is broken");
    };
    assert!(broken.contains("unit 2 point 0x0011 stays off"), "{broken}");

    let (mut line, plan) = wired(WIRES);
    line.wires.push([(1, 16), (2, 17)]);
    let crossed = failing((line, plan)).concat();
    has(&crossed, &["unit 2 point 0x0011 changed to on as well"]);

    let other_unit = WIRES.replace("unit = 2, point = 17", "unit = 3, point = 17");
    let silent = failing(wired(&other_unit)).concat();
    assert!(silent.contains("an answer from unit 3"), "{silent}");

    let inverted = WIRES.replacen("}\n[[", "}\ninverted = true\n[[", 1);
    let inverted = failing(wired(&inverted)).concat();
    has(&inverted, &["unit 2 point 0x0010 stays off"]);
}

const PULSES: &str =
    "[[wire]]\nfrom = { point = 16 }\nto = { unit = 2, point = 16 }\npulses = 50\n";

#[test]
fn pulses_that_are_all_counted_pass_and_any_other_count_fails() {
    for (counts, verdict) in [(1, None), (0, Some("counted 0")), (2, Some("counted 100"))] {
        let (mut line, plan) = wired(PULSES);
        line.counts = counts;
        let (report, ended) = run_plan(&mut line, &plan, &never());
        assert_eq!(ended, Ok(()));
        let [wire, pulses] = &report.findings[..] else {
            panic!("{:?}", report.findings);
        };
        assert_eq!(wire.verdict, Verdict::Passed);
        let shown = pulses.to_string();
        assert!(
            shown.starts_with("pulses/unit 1 point 0x0010 to unit 2"),
            "{shown}"
        );
        match verdict {
            None => assert_eq!(pulses.verdict, Verdict::Passed),
            Some(came) => assert!(shown.contains("FAILED") && shown.contains(came), "{shown}"),
        }
        assert!(line.units[0].bits[16], "put back");
    }
}

const ANALOG: &str = "[[analog]]\nfrom = { point = 18 }\nto = { point = 16 }\ntolerance = 20\n\
                      [[analog]]\nfrom = { point = 19 }\nto = { point = 17 }\ntolerance = 20\n";

/// Returns a unit whose two analog outputs are wired to its two analog inputs, each with an error of 20 codes.
fn analog() -> (Line, Plan) {
    let mut line = Line::new(&[1]);
    line.analog = vec![([(1, 18), (1, 16)], 20), ([(1, 19), (1, 17)], 20)];
    line.units[0].registers.insert(18, 1234);
    let plan = Plan {
        analog: BenchFile::parse(ANALOG, None).unwrap().analog(),
        ..plan(&line)
    };
    (line, plan)
}

#[test]
fn analog_wires_within_the_tolerance_pass_and_outputs_are_restored() {
    let (mut line, plan) = analog();
    let (report, ended) = run_plan(&mut line, &plan, &never());
    assert_eq!(ended, Ok(()));
    assert_eq!(report.totals().passed, 2, "{:?}", report.findings);
    assert_eq!(report.findings[0].note, "largest difference 20");
    assert_eq!(line.units[0].registers[&18], 1234);
    assert_eq!(line.units[0].registers.get(&19), Some(&0));
}

#[test]
fn wrong_analog_wires_fail_each_with_its_reason() {
    let (mut line, plan) = analog();
    line.analog[1].1 = 21;
    let [inexact] = &failing((line, plan))[..] else {
        panic!("one wire is inexact");
    };
    has(inexact, &["unit 1 point 0x0011 is 21 after"]);

    let (mut line, plan) = analog();
    line.analog.pop();
    let [broken] = &failing((line, plan))[..] else {
        panic!("one wire is broken");
    };
    has(broken, &["unit 1 point 0x0011 is 0 after"]);

    let (mut line, plan) = analog();
    line.analog[1].0[0] = (1, 18);
    let crossed = failing((line, plan)).concat();
    has(
        &crossed,
        &["unit 1 point 0x0011 changed from 20 to 4115 as well"],
    );

    let (mut line, plan) = analog();
    let scale = register_map::configuration::SCALE + 16;
    line.units[0].registers.insert(scale, 1);
    let [differs] = &failing((line, plan))[..] else {
        panic!("one wire has two scales");
    };
    assert!(differs.contains("the same signal and scale"), "{differs}");
}

#[test]
fn interrupt_during_the_wires_restores_outputs() {
    let (mut line, plan) = wired(WIRES);
    let stop = Arc::new(never());
    let pressed = Arc::clone(&stop);
    line.watch = Box::new(move |frame, _| {
        let on = frame[1] == 5 && frame[4] == 0xFF;
        pressed.fetch_or(on, Ordering::Relaxed);
        Fate::Good
    });
    let (report, ended) = run_plan(&mut line, &plan, &stop);
    assert_eq!(ended, Ok(()));
    assert!(report.interrupted);
    assert_eq!(report.findings.len(), 1);
    assert_eq!(line.units[0].bits[16..18], [true, false]);
}
