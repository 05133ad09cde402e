//! Tests of the workflows of GitHub, which nothing here can run.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use ed25519_dalek::{Signer as _, SigningKey};
use register_map::Board;

/// The workflows of CI and of the nights.
const WORKFLOWS: [&str; 2] = [
    include_str!("../../.github/workflows/ci.yml"),
    include_str!("../../.github/workflows/nightly.yml"),
];

#[test]
fn matrix_of_every_board_runs_at_night() {
    let [_, nightly] = WORKFLOWS;
    for board in Board::ALL {
        let run = format!("run: cargo xtask matrix --board {board}\n");
        assert!(
            nightly.contains(&run),
            "{board} is in no job of nightly.yml"
        );
    }
}

#[test]
fn workflows_name_every_action_by_its_commit_and_every_artifact_by_its_name() {
    for line in WORKFLOWS.iter().flat_map(|workflow| workflow.lines()) {
        if let Some((_, action)) = line.split_once("uses: ") {
            let (_, commit) = action.split_once('@').expect(line);
            let commit = commit.split_whitespace().next().expect(line);
            let hex = commit.bytes().all(|byte| byte.is_ascii_hexdigit());
            assert!(commit.len() == 40 && hex, "{line}");
        }
        assert!(!line.trim_start().starts_with("pattern:"), "{line}");
    }
}

#[test]
fn every_install_command_uses_the_lock_file() {
    let pages = [
        include_str!("../../README.md"),
        include_str!("../../CONTRIBUTING.md"),
        include_str!("../../docs/commissioning.md"),
        include_str!("../../docs/radio.md"),
        include_str!("../../docs/testing.md"),
        include_str!("../../.ci/run"),
    ];
    for line in pages.iter().chain(&WORKFLOWS).flat_map(|page| page.lines()) {
        let installs = line.contains("cargo install");
        assert!(!installs || line.contains("--locked"), "{line}");
    }
}

#[cfg(unix)]
#[test]
fn files_of_a_release_that_differ_from_their_check_sums_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        std::fs::write(directory.path().join(name), text).unwrap();
    };
    // The SHA-256 of "a".
    let sums = "  ca978112ca1bbdcafac231b39a23dc4da786eff8147c4e72b9807785afee48bb  a\n\n";
    let accepted = |sums: &str| {
        let mut check = Command::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.ci/check-sums"));
        let check = check.arg(directory.path()).env("SUMS", sums);
        check.output().unwrap().status.success()
    };
    write("a", "a");
    write("SHA256SUMS", "the check sums of one job");
    assert!(accepted(sums));
    assert!(!accepted(""));
    write("b", "a file that no job has built");
    assert!(!accepted(sums));
    std::fs::remove_file(directory.path().join("b")).unwrap();
    write("a", "b");
    assert!(!accepted(sums));
    std::fs::remove_file(directory.path().join("a")).unwrap();
    assert!(!accepted(sums));
}

/// A job of a workflow: what it may do, and its steps.
#[derive(serde::Deserialize)]
struct Job {
    environment: Option<String>,
    steps: Vec<serde_yaml_ng::Value>,
}

#[derive(serde::Deserialize)]
struct Workflow {
    jobs: BTreeMap<String, Job>,
}

/// A script of a dependency runs when it is compiled, and could send the key away or sign something else.
#[test]
fn job_with_a_secret_compiles_nothing_and_runs_no_code_of_the_sources() {
    let [ci, nightly] = WORKFLOWS;
    assert!(!nightly.contains("secrets."));
    let Workflow { jobs } = serde_yaml_ng::from_str(ci).unwrap();
    let mut with_secret = Vec::new();
    for (name, job) in &jobs {
        let text = serde_yaml_ng::to_string(&job.steps).unwrap();
        if job.environment.is_none() && !text.contains("secrets.") {
            continue;
        }
        with_secret.push(name.as_str());
        for code in ["cargo", "rustup", "checkout", ".ci/", "npm", "pip "] {
            assert!(!text.contains(code), "{name} has {code}");
        }
        for step in &job.steps {
            let uses = step.get("uses").and_then(|uses| uses.as_str());
            let moves = |uses: &str| {
                uses.starts_with("actions/download-artifact@")
                    || uses.starts_with("actions/upload-artifact@")
            };
            assert!(uses.is_none_or(moves), "{name}: {uses:?}");
        }
    }
    assert_eq!(with_secret, ["sign"]);
}

/// Returns the script of the job that signs.
fn script() -> String {
    let Workflow { jobs } = serde_yaml_ng::from_str(WORKFLOWS[0]).unwrap();
    let scripts = jobs["sign"].steps.iter().filter_map(|step| step.get("run"));
    let scripts: Vec<_> = scripts.filter_map(|script| script.as_str()).collect();
    assert_eq!(scripts.len(), 1);
    scripts[0].to_owned()
}

/// Runs the script in a directory with these bytes to be signed. Returns the signature.
fn signed(part: &[u8], sums: Option<&str>, key: &str) -> Option<Vec<u8>> {
    let directory = tempfile::tempdir().unwrap();
    let unsigned = directory.path().join("unsigned");
    let write = |name: &str, bytes: &[u8]| std::fs::write(unsigned.join(name), bytes).unwrap();
    std::fs::create_dir(&unsigned).unwrap();
    write("modio-02-a.tbs", part);
    let listed = Command::new("sha256sum")
        .arg("modio-02-a.tbs")
        .current_dir(&unsigned)
        .output();
    let listed = String::from_utf8(listed.unwrap().stdout).unwrap();
    write("SHA256SUMS", listed.as_bytes());
    let mut bash = Command::new("bash");
    bash.args(["-c", &script()]).current_dir(directory.path());
    bash.env("SUMS", sums.unwrap_or(listed.trim_end()));
    bash.env("EPOCH", "3").env("MODIO_SIGNING_KEY", key);
    let done = bash.output().unwrap();
    let signature = std::fs::read(directory.path().join("signatures/modio-02-a.sig"));
    signature.ok().filter(|_| done.status.success())
}

/// The 92 bytes of a header of epoch 3.
fn part() -> Vec<u8> {
    let mut part: Vec<u8> = (0..92).map(|n| n as u8).collect();
    part[..8].copy_from_slice(b"MODI\x02\x01\x03\0");
    part
}

#[cfg(unix)]
#[test]
fn workflow_signs_as_xtask_does_and_refuses_what_is_not_expected() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("key");
    crate::keys::generate(&path).unwrap();
    let pem = std::fs::read_to_string(&path).unwrap();
    let key: SigningKey = crate::keys::private(&pem).unwrap();
    let right = part();
    let signature = signed(&right, None, &pem).expect("openssl signs");
    assert_eq!(signature, key.sign(&right).to_bytes());
    let changed = |at: usize| {
        let mut part = part();
        part[at] ^= 1;
        part
    };
    for (what, part, sums) in [
        ("another magic number", changed(0), None),
        ("another version of the header", changed(4), None),
        ("another epoch", changed(6), None),
        ("another length", part()[..91].to_vec(), None),
        ("other check sums", part(), Some("0000  modio-02-a.tbs")),
    ] {
        assert_eq!(signed(&part, sums, &pem), None, "{what}");
    }
    assert!(!Path::new("signatures").exists());
}
