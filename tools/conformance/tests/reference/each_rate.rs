//! Requests at each rate, to a modio on the reference server: what they find, and that the unit's rate is restored.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use conformance::cases::of_bench;
use conformance::endpoint::Endpoint as _;
use conformance::frame::Mode;
use conformance::hil::Hil;
use conformance::report::{Report, Totals, json, junit};
use conformance::run::{Verdict, run_until};
use conformance::tester::Tester;
use modbus_line::LineFormat;
use register_map::configuration::{BAUD, RESPONSE_DELAY};

use super::endpoint::Reference;
use super::probed;

const HOME: u32 = 9600;

fn modio() -> Reference {
    Reference::modio(None, Mode::Rtu, LineFormat::default())
}

/// Sends this number of requests at these rates. Returns the results, and why the run ended early, if it did.
fn measured(line: &mut Reference, requests: u32, rates: &[u32]) -> (Report, Result<(), String>) {
    let hil = Hil {
        requests,
        rates: rates.to_vec(),
        ..Hil::default()
    };
    measured_until(line, hil, &AtomicBool::new(false))
}

fn measured_until(
    line: &mut Reference,
    hil: Hil,
    stop: &AtomicBool,
) -> (Report, Result<(), String>) {
    let mut target = probed(line, Mode::Rtu, None);
    target.hil = hil;
    let mut cases = of_bench();
    cases.retain(|case| case.name == "timing/each-rate");
    let mut report = Report::default();
    let ended = run_until(line, &target, &cases, stop, |_| {}, &mut report.outcomes);
    (report, ended.map_err(|broken| broken.0))
}

/// The unit answers at the rate of before, also after it was switched off and on.
#[track_caller]
fn assert_at_home(line: &mut Reference) {
    assert_eq!(line.line().baud, HOME);
    line.way = Box::new(|bytes, _| bytes.to_vec());
    let target = probed(line, Mode::Rtu, None);
    line.set_power(false).unwrap();
    line.set_power(true).unwrap();
    line.rest(Duration::from_secs(1)).unwrap();
    let mut tester = Tester::new(line, &target);
    assert_eq!(tester.read_word(BAUD), Ok((HOME / 100) as u16));
}

#[track_caller]
fn has(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part}: {text}");
    }
}

fn is_echo(frame: &[u8]) -> bool {
    frame[1] == 8
}

#[test]
fn every_rate_is_measured_and_the_rate_is_restored() {
    let mut line = modio();
    let wanted = [9600, 115_200, 19_200];
    let (report, ended) = measured(&mut line, 50, &wanted);
    assert_eq!(ended, Ok(()));
    assert_eq!(report.outcomes.len(), 3);
    for (outcome, baud) in report.outcomes.iter().zip(wanted) {
        assert_eq!(outcome.name, format!("timing/{baud} 8N2"));
        assert_eq!(outcome.verdict, Verdict::Passed);
        let measured = &outcome.measured;
        let counted = ["baud", "sent", "lost", "wrong"].map(|name| measured[name].as_u64());
        assert_eq!(counted, [u64::from(baud), 50, 0, 0].map(Some));
        let t35 = measured["t35_us"].as_u64().unwrap();
        // The unit thinks for 40 us.
        for name in ["min", "median", "p99", "max"] {
            let time = measured["turnaround_us"][name].as_u64().unwrap();
            assert!((t35 + 39..t35 + 42).contains(&time), "{measured}");
        }
        has(
            &outcome.note,
            &["50 sent, 0 lost, 0 wrong", "turnaround in ms: min "],
        );
    }
    assert_at_home(&mut line);
}

#[test]
fn turnaround_below_frame_gap_and_above_a_limit_fail() {
    let mut line = modio();
    let hil = |limit: Option<u64>| Hil {
        requests: 5,
        limit: limit.map(Duration::from_millis),
        ..Hil::default()
    };
    for (limit, failed) in [(None, 0), (Some(5), 0), (Some(4), 1)] {
        let (report, _) = measured_until(&mut line, hil(limit), &AtomicBool::new(false));
        assert_eq!(Totals::of(&report.outcomes).failed, failed, "{limit:?}");
    }
    // The register says 50 ms, but the unit uses t3.5.
    let target = probed(&mut line, Mode::Rtu, None);
    let mut tester = Tester::new(&mut line, &target);
    tester.unlock().unwrap();
    let gap = register_map::configuration::FRAME_GAP;
    tester.set_words(gap, &[500]).unwrap();
    let (report, _) = measured(&mut line, 5, &[]);
    let json = json::value(&report).to_string();
    assert!(json.contains("at least: t3.5, or FRAME_GAP"), "{json}");
}

#[test]
fn line_whose_rate_cannot_be_set_is_measured_at_its_present_rate() {
    let mut line = modio();
    line.lacks = Some(HOME);
    let (report, ended) = measured(&mut line, 10, &[]);
    assert_eq!((ended, Totals::of(&report.outcomes).passed), (Ok(()), 1));
}

#[test]
fn lost_and_stale_replies_are_counted_apart_and_fail() {
    let mut line = modio();
    let mut echoes = 0;
    line.way = Box::new(move |frame, _| {
        echoes += u32::from(is_echo(frame));
        match echoes {
            10 | 20 => Vec::new(),
            30 => Mode::Rtu.frame(1, &[8, 0, 0, 0xFF, 0xFF]),
            _ => frame.to_vec(),
        }
    });
    let (report, ended) = measured(&mut line, 100, &[]);
    assert_eq!(ended, Ok(()));
    let [outcome] = &report.outcomes[..] else {
        panic!("{:?}", report.outcomes);
    };
    let Verdict::Failed(failure) = &outcome.verdict else {
        panic!("{outcome:?}");
    };
    has(
        &failure.came,
        &["2 lost, 1 wrong, the first to 01 08 00 00"],
    );
    assert_eq!(outcome.measured["sent"], 100);
    has(&junit::document(&report), &["tests=\"1\" failures=\"1\""]);
}

#[test]
fn measurement_ends_early_when_the_unit_stops_answering() {
    let mut line = modio();
    let mut echoes = 0;
    line.way = Box::new(move |frame, _| {
        echoes += u32::from(is_echo(frame));
        if echoes > 10 {
            return Vec::new();
        }
        frame.to_vec()
    });
    let (report, _) = measured(&mut line, 5000, &[]);
    let outcome = &report.outcomes[0];
    has(&outcome.note, &["given up after 20"]);
    assert!(outcome.measured["sent"].as_u64() < Some(40), "{outcome:?}");
}

#[test]
fn interrupt_at_another_rate_restores_the_rate_first() {
    let mut line = modio();
    let stop = Arc::new(AtomicBool::new(false));
    let pressed = Arc::clone(&stop);
    let mut echoes = 0;
    line.way = Box::new(move |frame, line| {
        echoes += u32::from(is_echo(frame) && line.baud == 19_200);
        pressed.store(echoes > 10, Ordering::Relaxed);
        frame.to_vec()
    });
    let hil = Hil {
        requests: 100,
        rates: vec![9600, 19_200, 38_400],
        ..Hil::default()
    };
    let (report, ended) = measured_until(&mut line, hil, &stop);
    assert_eq!(ended, Ok(()));
    let [first, second, rest] = &report.outcomes[..] else {
        panic!("{:?}", report.outcomes);
    };
    assert_eq!(first.measured["sent"], 100);
    assert!(second.measured["sent"].as_u64() < Some(100));
    assert_eq!(rest.verdict, Verdict::Skipped("interrupted".to_owned()));
    assert_at_home(&mut line);
}

#[test]
fn change_of_rate_that_fails_half_way_is_undone_in_the_stored_settings_too() {
    // The command to restart is lost: the new rate is stored, but not in force.
    let mut line = modio();
    let mut lose = true;
    line.way = Box::new(move |frame, _| {
        if frame.starts_with(&[1, 6, 1, 8, 0, 2]) && std::mem::take(&mut lose) {
            return Vec::new();
        }
        frame.to_vec()
    });
    let (report, ended) = measured(&mut line, 5, &[19_200]);
    assert_eq!(ended, Ok(()));
    has(&json::value(&report).to_string(), &["01 06 01 08 00 02"]);
    assert_eq!(Totals::of(&report.outcomes).failed, 1);
    assert_at_home(&mut line);
}

#[test]
fn rate_that_cannot_be_restored_is_an_error_with_the_rate_at_which_the_unit_last_answered() {
    let mut line = modio();
    line.way = Box::new(|frame, line| {
        // At the other rate the unit ignores configuration writes.
        let refused = line.baud != HOME && frame[1] == 6;
        if refused { Vec::new() } else { frame.to_vec() }
    });
    let (report, ended) = measured(&mut line, 5, &[19_200]);
    let text = ended.unwrap_err();
    has(&text, &["back to 9600 8N2", "last answered at 19200 8N2"]);
    assert_eq!(report.outcomes.len(), 1, "the report has the measurement");
}

#[test]
fn rate_that_the_port_does_not_support_is_an_error_before_the_unit_is_changed() {
    let mut line = modio();
    line.lacks = Some(921_600);
    let (report, ended) = measured(&mut line, 5, &[19_200, 921_600]);
    assert_eq!(ended.unwrap_err(), "this line does not take 921600 8N2");
    assert!(report.outcomes.is_empty());
    assert_at_home(&mut line);
}

#[test]
fn a_unit_with_unsaved_settings_keeps_its_rate() {
    let mut line = modio();
    let target = probed(&mut line, Mode::Rtu, None);
    let mut tester = Tester::new(&mut line, &target);
    tester.unlock().unwrap();
    tester.set_words(RESPONSE_DELAY, &[1]).unwrap();
    let (report, ended) = measured(&mut line, 5, &[19_200]);
    has(&ended.unwrap_err(), &["not saved", "set back to 9600 8N2"]);
    assert!(report.outcomes.is_empty());
    // The setting was not stored.
    assert_at_home(&mut line);
    assert_eq!(
        Tester::new(&mut line, &target).read_word(RESPONSE_DELAY),
        Ok(0)
    );
}
