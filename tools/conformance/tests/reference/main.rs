//! Runs the suite against a unit made of the reference server. Without a fault the unit passes every case. Each fault
//! makes the cases fail that have to find it.

mod command;
mod each_rate;
mod endpoint;
mod fast;
mod fault;
mod modio;
mod modio_fault;
mod server;
mod unit;

use std::collections::BTreeSet;
use std::time::Duration;

use conformance::case::{Case, Kind, Need};
use conformance::cases::all;
use conformance::cli::waits;
use conformance::endpoint::Endpoint as _;
use conformance::frame::Mode;
use conformance::probe::{Given, probe};
use conformance::profile::Profile;
use conformance::run::{Outcome, Verdict, run};
use conformance::target::Target;
use conformance::tester::Tester;

use endpoint::Reference;
use fault::{FAULTS, Fault};
use modbus_line::LineFormat;
use modio_fault::{MODIO_FAULTS, ModioFault};
use register_map::configuration;

const PROFILE: &str = r#"
unit = 9

[coils]
read = ["100-2199"]
write = ["100-2199"]

[discrete_inputs]
read = ["0-18"]

[holding_registers]
read = ["1000-1199"]
write = ["1000-1199"]
values = [1, 4000]
refused = 4096

[input_registers]
read = ["50-59"]
"#;

/// A line at 9600 bit/s with the reference unit on it.
fn reference(fault: Option<Fault>, mode: Mode, format: &str) -> Reference {
    let line = LineFormat::new(9600, format.parse().unwrap());
    Reference::new(fault, mode, line)
}

/// Runs these cases. The unit has this fault.
fn outcomes(
    mut endpoint: Reference,
    fault: Option<Fault>,
    mode: Mode,
    cases: &[Case],
) -> Vec<Outcome> {
    // Some faults would mislead the probe, so it gets the functions of a unit without a fault.
    let mut profile = Profile::parse(PROFILE).unwrap();
    if fault.is_some() {
        profile.functions = Some(conformance::probe::FUNCTIONS.to_vec());
    }
    let target = probed(&mut endpoint, mode, Some(&profile));
    run(&mut endpoint, &target, cases).unwrap()
}

/// Asks the unit of this profile, or the modio.
fn probed(endpoint: &mut Reference, mode: Mode, profile: Option<&Profile>) -> Target {
    let given = given(endpoint, mode, profile);
    probe(endpoint, &given).unwrap()
}

/// What a user gives to have the unit of this profile tested, or the modio.
fn given<'a>(endpoint: &Reference, mode: Mode, profile: Option<&'a Profile>) -> Given<'a> {
    Given {
        unit: profile
            .map_or(Some(modio::UNIT), |profile| profile.unit)
            .unwrap(),
        mode,
        patience: waits(endpoint, None),
        profile,
        allow_config: profile.is_none(),
    }
}

fn assert_passes(endpoint: Reference, mode: Mode) -> Vec<&'static str> {
    assert_passes_in_order(endpoint, mode, &all())
}

fn assert_passes_in_order(endpoint: Reference, mode: Mode, cases: &[Case]) -> Vec<&'static str> {
    let outcomes = outcomes(endpoint, None, mode, cases);
    let mut passed = Vec::new();
    for outcome in &outcomes {
        match &outcome.verdict {
            Verdict::Passed => passed.push(outcome.case.name),
            Verdict::Skipped(_) => {}
            Verdict::Failed(_) => panic!("{}", conformance::report::table::row(outcome)),
        }
    }
    passed
}

#[test]
fn server_without_a_fault_passes_every_case_that_is_not_about_a_modio() {
    let passed: Vec<&str> = [
        assert_passes(reference(None, Mode::Rtu, "8E1"), Mode::Rtu),
        assert_passes(reference(None, Mode::Ascii, "7E1"), Mode::Ascii),
    ]
    .concat();
    for case in all() {
        let about_modio = case.needs.contains(&Need::Modio);
        assert_eq!(
            passed.contains(&case.name),
            !about_modio,
            "{} runs against the reference",
            case.name
        );
    }
}

/// A case that depends on what a case before it has left fails in another order.
#[test]
fn cases_pass_in_the_reverse_order_too() {
    let reversed: Vec<Case> = all().into_iter().rev().collect();
    for (mode, format) in [(Mode::Rtu, "8E1"), (Mode::Ascii, "7E1")] {
        let passed = assert_passes(reference(None, mode, format), mode);
        let mut back = assert_passes_in_order(reference(None, mode, format), mode, &reversed);
        back.reverse();
        assert_eq!(back, passed);
    }
    assert_modio_passes(reversed);
}

#[test]
fn with_8n1_a_unit_passes_that_counts_characters_of_11_or_of_10_bits() {
    let unit = || reference(None, Mode::Rtu, "8N1");
    assert_passes(unit(), Mode::Rtu);
    assert_passes(unit().counting_own_characters(), Mode::Rtu);
}

#[test]
fn unit_that_is_silent_to_incomplete_writes_passes() {
    let unit = reference(None, Mode::Rtu, "8E1").silent_to_incomplete_writes();
    assert_passes(unit, Mode::Rtu);
}

#[test]
fn unit_that_starts_is_waited_for_and_an_absent_one_is_an_error() {
    let profile = Profile::parse(PROFILE).unwrap();
    for profile in [None, Some(&profile)] {
        let line = LineFormat::default();
        let starting_for = |time| match profile {
            None => Reference::modio(None, Mode::Rtu, line).starting_for(time),
            Some(_) => Reference::new(None, Mode::Rtu, line).starting_for(time),
        };
        let mut late = starting_for(Duration::from_secs(2));
        probed(&mut late, Mode::Rtu, profile);

        let mut absent = starting_for(Duration::MAX / 2);
        let begin = absent.now();
        let given = given(&absent, Mode::Rtu, profile);
        let error = probe(&mut absent, &given).unwrap_err().to_string();
        let unit = given.unit;
        let expected = format!("unit {unit} does not answer at 9600 8N2: check its address");
        assert!(error.starts_with(&expected), "{error}");
        let waited = absent.now() - begin;
        assert!((3..4).contains(&waited.as_secs()), "{waited:?}");
    }
}

#[test]
fn every_fault_is_found_by_its_case() {
    let mut missed = Vec::new();
    for (fault, cases) in FAULTS {
        for name in *cases {
            let Some(case) = all().into_iter().find(|case| case.name == *name) else {
                panic!("no case {name}");
            };
            let mode = if case.needs.contains(&Need::Ascii) {
                Mode::Ascii
            } else {
                Mode::Rtu
            };
            let endpoint = reference(Some(*fault), mode, "8E1");
            let outcomes = outcomes(endpoint, Some(*fault), mode, &[case]);
            if !matches!(outcomes[0].verdict, Verdict::Failed(_)) {
                missed.push((fault, name, outcomes[0].verdict.clone()));
            }
        }
    }
    assert!(missed.is_empty(), "not found: {missed:#?}");
}

fn outcomes_of_modio(fault: Option<ModioFault>, cases: &[Case]) -> Vec<Outcome> {
    let mut endpoint = Reference::modio(fault, Mode::Rtu, LineFormat::default());
    let target = probed(&mut endpoint, Mode::Rtu, None);
    run(&mut endpoint, &target, cases).unwrap()
}

#[test]
fn modio_without_a_fault_passes_every_case_about_a_modio() {
    assert_modio_passes(all());
}

fn assert_modio_passes(mut cases: Vec<Case>) {
    // The board of this modio has no output stage.
    cases.retain(|case| case.kind == Kind::Modio && !case.name.starts_with("stage/"));
    for outcome in outcomes_of_modio(None, &cases) {
        let row = conformance::report::table::row(&outcome);
        assert_eq!(outcome.verdict, Verdict::Passed, "{row}");
    }
}

#[test]
fn every_fault_of_a_modio_is_found_by_its_case() {
    let mut missed = Vec::new();
    for (fault, cases) in MODIO_FAULTS {
        for name in *cases {
            let mut case = all();
            case.retain(|case| case.name == *name);
            assert_eq!(case.len(), 1, "{name} is the name of a case");
            let verdict = outcomes_of_modio(Some(*fault), &case).remove(0).verdict;
            if !matches!(verdict, Verdict::Failed(_)) {
                missed.push((fault, name, verdict));
            }
        }
    }
    assert!(missed.is_empty(), "not found: {missed:#?}");
}

#[test]
fn every_case_has_a_fault_that_makes_it_fail() {
    let of_any = FAULTS.iter().flat_map(|(_, cases)| *cases);
    let of_modio = MODIO_FAULTS.iter().flat_map(|(_, cases)| *cases);
    let proven: BTreeSet<&str> = of_any.chain(of_modio).copied().collect();
    let unproven: Vec<&str> = all()
        .iter()
        .map(|case| case.name)
        .filter(|name| !proven.contains(name))
        .collect();
    assert!(unproven.is_empty(), "cases without a fault: {unproven:?}");
}

#[test]
fn unsaved_settings_are_dropped_only_after_a_case_that_may_write_settings() {
    let mut endpoint = Reference::modio(None, Mode::Rtu, LineFormat::default());
    let target = probed(&mut endpoint, Mode::Rtu, None);
    let safe = configuration::SAFE + 0x12;
    for (name, wanted) in [("fc02/same-as-01", 1), ("config/all-or-nothing", 0)] {
        let mut tester = Tester::new(&mut endpoint, &target);
        tester.unlock().unwrap();
        tester.set_words(safe, &[1]).unwrap();
        let mut case = all();
        case.retain(|case| case.name == name);
        let verdict = run(&mut endpoint, &target, &case)
            .unwrap()
            .remove(0)
            .verdict;
        assert_eq!(verdict, Verdict::Passed);
        let mut tester = Tester::new(&mut endpoint, &target);
        assert_eq!(tester.read_word(safe), Ok(wanted), "after {name}");
    }
}

#[test]
fn points_that_cases_write_to_are_restored() {
    let line = LineFormat::default();
    let mut endpoint = Reference::new(None, Mode::Rtu, line);
    let profile = Profile::parse(PROFILE).unwrap();
    let target = probed(&mut endpoint, Mode::Rtu, Some(&profile));
    let mut tester = Tester::new(&mut endpoint, &target);
    tester.set_bits(100, &[true, false, true]).unwrap();
    tester.set_words(1000, &[17, 18, 19]).unwrap();
    let before = tester.snapshot().unwrap();
    let mut cases = all();
    cases.retain(|case| !case.name.starts_with("power/"));
    run(&mut endpoint, &target, &cases).unwrap();
    let mut tester = Tester::new(&mut endpoint, &target);
    assert_eq!(tester.snapshot().unwrap(), before);
}
