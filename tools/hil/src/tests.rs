//! Runs a plan against fake units: its results, and that it restores the units.

use std::sync::Arc;

use super::fake::{Fate, Line, TURNAROUND};
use super::*;
use conformance::cli::waits;

pub(super) fn plan(line: &Line) -> Plan {
    Plan {
        unit: 1,
        module: None,
        patience: waits(line, None),
        allow_config: false,
        cases: Vec::new(),
        requests: 0,
        rates: Vec::new(),
        limit: None,
        wires: Vec::new(),
        analog: Vec::new(),
    }
}

pub(super) fn run_plan(
    line: &mut Line,
    plan: &Plan,
    stop: &AtomicBool,
) -> (Report, Result<(), String>) {
    let mut report = Report::default();
    let ended = run(line, plan, stop, &mut report, &mut |_| {});
    (report, ended.map_err(|error| format!("{error:#}")))
}

/// Asserts that a text has these parts.
#[track_caller]
pub(super) fn has(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part}: {text}");
    }
}

pub(super) fn never() -> AtomicBool {
    AtomicBool::new(false)
}

/// Measures with this number of requests at these rates.
fn measured(line: &mut Line, requests: u32, rates: &[u32]) -> (Report, Result<(), String>) {
    let plan = Plan {
        requests,
        rates: rates.to_vec(),
        ..plan(line)
    };
    run_plan(line, &plan, &never())
}

fn is_echo(frame: &[u8]) -> bool {
    frame[1] == 8
}

#[test]
fn every_rate_is_measured_and_the_unit_is_restored() {
    let mut line = Line::new(&[1]);
    let home = line.line();
    let wanted = [9600, 115_200, 19_200];
    let (report, ended) = measured(&mut line, 50, &wanted);
    assert_eq!(ended, Ok(()));
    let rates: Vec<u32> = report.timing.iter().map(|tally| tally.line.baud).collect();
    assert_eq!(rates, wanted);
    for tally in &report.timing {
        assert_eq!((tally.sent, tally.lost, tally.wrong), (50, 0, 0));
        assert_eq!(tally.spread.as_ref().unwrap().percentile(50), TURNAROUND);
    }
    assert_eq!(report.totals().passed, 3);
    assert_eq!((line.line(), line.units[0].line), (home, home));
    assert_eq!(line.units[0].stored, [96, 0]);
    assert_eq!(report.json()["timing"][1]["turnaround_us"]["p99"], 4100);
}

#[test]
fn turnaround_below_t35_fails_the_run() {
    let mut line = Line::new(&[1]);
    // The fake unit answers after 4.1 ms at every rate; t3.5 is 32 ms at 1200 bit/s.
    let (report, ended) = measured(&mut line, 5, &[9600, 1200]);
    assert_eq!(ended, Ok(()));
    assert_eq!((report.totals().passed, report.totals().failed), (1, 1));
    let json = report.json().to_string();
    assert!(json.contains("at least: t3.5, or FRAME_GAP"), "{json}");
}

#[test]
fn endpoint_whose_rate_cannot_be_set_is_measured_at_its_present_rate() {
    let mut line = Line::new(&[1]);
    line.lacks = Some(line.line().baud);
    let (report, ended) = measured(&mut line, 10, &[]);
    assert_eq!((ended, report.totals().passed), (Ok(()), 1));
}

#[test]
fn lost_and_stale_replies_are_counted_apart_and_fail_the_run() {
    let mut line = Line::new(&[1]);
    let mut count = 0;
    line.watch = Box::new(move |frame, _| {
        count += u32::from(is_echo(frame));
        match count {
            10 | 20 => Fate::Lost,
            30 => Fate::Stale,
            _ => Fate::Good,
        }
    });
    let (report, ended) = measured(&mut line, 100, &[]);
    assert_eq!(ended, Ok(()));
    let tally = &report.timing[0];
    let counted = (tally.sent, tally.lost, tally.wrong);
    assert_eq!(counted, (100, 2, 1), "{tally}");
    let Verdict::Failed(failure) = &report.findings[0].verdict else {
        panic!("{}", report.findings[0]);
    };
    has(
        &failure.came,
        &["2 lost, 1 wrong, the first to 01 08 00 00"],
    );
    assert!(report.failed().eq(["timing/9600 8N2"]));
    has(
        &report.junit(),
        &["name=\"hil\" tests=\"1\" failures=\"1\""],
    );
}

#[test]
fn measurement_ends_early_when_the_unit_stops_answering() {
    let mut line = Line::new(&[1]);
    let mut echoes = 0;
    line.watch = Box::new(move |frame, _| {
        echoes += u32::from(is_echo(frame));
        if echoes > 10 { Fate::Lost } else { Fate::Good }
    });
    let (report, _) = measured(&mut line, 5000, &[]);
    let tally = &report.timing[0];
    assert!(tally.given_up && tally.sent < 40, "{tally}");
}

#[test]
fn slow_unit_fails_only_against_a_limit() {
    let mut line = Line::new(&[1]);
    let mut plan = Plan {
        requests: 5,
        ..plan(&line)
    };
    for (limit, failed) in [(None, 0), (Some(5), 0), (Some(4), 1)] {
        plan.limit = limit.map(Duration::from_millis);
        let (report, _) = run_plan(&mut line, &plan, &never());
        assert_eq!(report.totals().failed, failed, "{limit:?}");
    }
}

#[test]
fn interrupt_at_another_rate_restores_the_rate_first() {
    let mut line = Line::new(&[1]);
    let home = line.line();
    let stop = Arc::new(never());
    let pressed = Arc::clone(&stop);
    let mut echoes = 0;
    line.watch = Box::new(move |frame, line| {
        echoes += u32::from(is_echo(frame) && line.baud == 19_200);
        pressed.store(echoes > 10, Ordering::Relaxed);
        Fate::Good
    });
    let plan = Plan {
        requests: 100,
        rates: vec![9600, 19_200, 38_400],
        ..plan(&line)
    };
    let (report, ended) = run_plan(&mut line, &plan, &stop);
    assert_eq!(ended, Ok(()));
    assert!(report.interrupted);
    let sent: Vec<u32> = report.timing.iter().map(|tally| tally.sent).collect();
    assert!(
        sent[0] == 100 && sent[1] < 100 && sent.len() == 2,
        "{sent:?}"
    );
    assert_eq!((line.line(), line.units[0].line), (home, home));
    assert_eq!(line.units[0].stored, [96, 0]);
}

#[test]
fn change_of_rate_that_fails_half_way_is_undone_in_the_stored_settings_too() {
    // The command to restart is lost: the new rate is stored, but not in force.
    let mut line = Line::new(&[1]);
    let mut lose = true;
    line.watch = Box::new(move |frame, _| {
        if frame.starts_with(&[1, 6, 1, 8, 0, 2]) && std::mem::take(&mut lose) {
            return Fate::Lost;
        }
        Fate::Good
    });
    let (_, ended) = measured(&mut line, 5, &[19_200]);
    assert!(ended.unwrap_err().contains("01 06 01 08 00 02"));
    assert_eq!(line.units[0].line.baud, 9600);
    assert_eq!(line.units[0].stored, [96, 0]);
    assert_eq!(line.units[0].saves, 2);
}

#[test]
fn rate_that_cannot_be_restored_is_an_error_with_the_rate_at_which_the_unit_last_answered() {
    let mut line = Line::new(&[1]);
    line.watch = Box::new(|frame, line| {
        // At the other rate the unit ignores configuration writes.
        let refused = line.baud != 9600 && frame[1] == 6;
        if refused { Fate::Lost } else { Fate::Good }
    });
    let (report, ended) = measured(&mut line, 5, &[19_200]);
    let text = ended.unwrap_err();
    has(&text, &["back to 9600 8N2", "last answered at 19200 8N2"]);
    assert_eq!(report.timing.len(), 1, "the report has the measurement");
}

#[test]
fn rate_that_the_port_does_not_support_is_an_error_before_the_unit_is_changed() {
    let mut line = Line::new(&[1]);
    line.lacks = Some(921_600);
    let (report, ended) = measured(&mut line, 5, &[19_200, 921_600]);
    assert_eq!(ended.unwrap_err(), "a fake does not take 921600 8N2");
    assert_eq!((report.timing.len(), line.units[0].saves), (0, 0));
    assert_eq!(line.line().baud, 9600);
}

#[test]
fn a_unit_with_unsaved_settings_keeps_its_rate() {
    let mut line = Line::new(&[1]);
    line.units[0].registers.insert(state::STATUS, 1 << 3);
    let (_, ended) = measured(&mut line, 5, &[19_200]);
    assert!(ended.unwrap_err().contains("not saved"));
    assert_eq!(line.units[0].saves, 0);
}

#[test]
fn unit_with_another_module_than_the_bench_is_not_tested() {
    let mut line = Line::new(&[1]);
    let plan = Plan {
        module: Some(Module::Ao4),
        requests: 5,
        ..plan(&line)
    };
    let (report, ended) = run_plan(&mut line, &plan, &never());
    let error = "unit 1 has the module 4do in force, but the bench has 4ao";
    assert_eq!(ended.unwrap_err(), error);
    assert!(report.timing.is_empty());
    let plan = Plan {
        module: Some(Module::Do4),
        ..plan
    };
    assert_eq!(run_plan(&mut line, &plan, &never()).1, Ok(()));
}

#[test]
fn reports_say_which_unit_was_tested() {
    let mut line = Line::new(&[1]);
    let registers = &mut line.units[0].registers;
    registers.insert(state::FIRMWARE_VERSION, 0x0102);
    registers.insert(state::FIRMWARE_PATCH, 3);
    registers.insert(state::UNIQUE_ID, 0xABCD);
    let (report, _) = measured(&mut line, 5, &[]);
    let unit = &report.json()["about"]["unit"];
    assert_eq!(unit["firmware"], "1.2.3");
    assert_eq!(unit["identity"], "ABCD00000000000000000000");
    assert_eq!(
        (&unit["module"], unit["commit"].is_null()),
        (&"4do".into(), true)
    );
    let xml = report.junit();
    has(&xml, &["<property name=\"firmware\" value=\"1.2.3\"/>"]);

    // Register map 2 has the commit.
    let registers = &mut line.units[0].registers;
    registers.insert(state::MAP_VERSION, 2);
    registers.extend([(0x020C, 0x0123), (0x020D, 0xABCD), (0x020E, 1)]);
    let (report, _) = measured(&mut line, 5, &[]);
    assert_eq!(report.json()["about"]["unit"]["commit"], "0123abcd-dirty");
}

#[test]
fn silent_unit_is_an_error_in_one_line() {
    let mut line = Line::new(&[2]);
    let (_, ended) = run_plan(&mut line, &plan(&Line::new(&[1])), &never());
    let text = ended.unwrap_err();
    assert!(
        text.starts_with("unit 1 does not answer at 9600 8N2"),
        "{text}"
    );
}
