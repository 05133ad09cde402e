//! Names, logs and refusals.

use std::time::Duration;

use clap::ValueEnum;

use super::log::{self, Finding};
use super::*;

#[test]
fn the_targets_are_those_of_the_fuzz_crate() {
    let workspace = Workspace::open().unwrap();
    let manifest = fs::read_to_string(workspace.root().join(MANIFEST)).unwrap();
    assert_eq!(manifest.matches("[[bin]]").count(), Target::ALL.len());
    for target in Target::ALL {
        let name = target.name();
        assert!(manifest.contains(&format!("name = \"{name}\"")), "{name}");
        assert_eq!(target.to_possible_value().unwrap().get_name(), name);
        let seeds = workspace.root().join(SEEDS).join(name);
        assert!(fs::read_dir(seeds).unwrap().count() > 10, "{name}");
    }
}

#[test]
fn a_run_is_summed_up() {
    let text = "INFO: seed corpus: files: 3\n\
        #4\tINITED cov: 100 ft: 120 corp: 3/60b exec/s: 0 rss: 30Mb\n\
        #16580\tDONE   cov: 412 ft: 1633 corp: 301/12Kb lim: 48 exec/s: 637 rss: 28Mb\n\
        Done 16580 runs in 26 second(s)\n";
    assert_eq!(
        log::summary(text, Duration::from_secs(26)),
        "16580 executions in 26 s, 412 places covered, 301 inputs, nothing found"
    );
}

#[test]
fn a_panic_is_told_with_its_input() {
    let text = "#9\tNEW    cov: 1\n\
        thread '<unnamed>' (7) panicked at src/pdu.rs:103:9:\n\
        assertion failed: left == right\n\
        note: run with `RUST_BACKTRACE=1`\n\
        ==7== ERROR: libFuzzer: deadly signal\n\
        artifact_prefix='/t/'; Test unit written to /t/pdu-crash-22\n\
        Base64: AA==\n";
    let finding = log::finding(text).unwrap();
    assert_eq!(finding.file, "/t/pdu-crash-22");
    assert!(
        finding
            .what
            .ends_with("103:9:\nassertion failed: left == right")
    );
}

#[test]
fn a_time_out_is_told_with_its_input() {
    let text = "ALARM: working on the last Unit for 11 seconds\n\
        ==7== ERROR: libFuzzer: timeout after 11 seconds\n\
        artifact_prefix='/t/'; Test unit written to /t/store-timeout-1\n";
    let expected = Finding {
        what: "libFuzzer: timeout after 11 seconds".to_owned(),
        file: "/t/store-timeout-1".to_owned(),
    };
    assert_eq!(log::finding(text), Some(expected));
    assert_eq!(log::finding("INFO: Seed: 1\n"), None);
}

#[test]
fn an_input_that_is_not_there_is_refused_before_anything_is_built() {
    let workspace = Workspace::open().unwrap();
    let failure = again(&workspace, Target::Pdu, Path::new("/nowhere/pdu")).unwrap_err();
    assert_eq!(failure.to_string(), "there is no input /nowhere/pdu");
    assert_eq!(failure.code, 2);
}
