//! Tests of the workflows of GitHub, which nothing here can run.

use std::collections::BTreeMap;

use register_map::Row;
use serde_yaml_ng::Value;

/// The workflows of CI and of the nights.
const WORKFLOWS: [&str; 2] = [
    include_str!("../../.github/workflows/ci.yml"),
    include_str!("../../.github/workflows/nightly.yml"),
];

#[test]
fn matrix_of_every_board_runs_at_night() {
    let [_, nightly] = WORKFLOWS;
    let runs = Row::ALL.map(|board| format!("run: cargo xtask matrix --board {board}\n"));
    let missing: String = runs
        .into_iter()
        .filter(|run| !nightly.contains(run))
        .collect();
    assert!(missing.is_empty(), "no job of nightly.yml has:\n{missing}");
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
    use std::process::Command;

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

/// The steps of a job.
#[derive(serde::Deserialize)]
struct Job {
    steps: Vec<Value>,
}

#[derive(serde::Deserialize)]
struct Workflow {
    on: Value,
    jobs: BTreeMap<String, Job>,
}

#[test]
fn these_are_all_workflows_and_none_runs_for_a_stranger_with_rights() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../.github/workflows");
    let mut names: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|file| file.unwrap().file_name())
        .collect();
    names.sort_unstable();
    assert_eq!(names, ["ci.yml", "nightly.yml"]);
    let allowed = ["push", "pull_request", "workflow_dispatch", "schedule"];
    for workflow in WORKFLOWS {
        let Workflow { on, .. } = serde_yaml_ng::from_str(workflow).unwrap();
        for event in on.as_mapping().unwrap().keys() {
            assert!(allowed.contains(&event.as_str().unwrap()), "{event:?}");
        }
    }
}

/// A script of a dependency runs when it is compiled, and could send the key away or have something else signed. So the
/// job with the key is exactly this one, and no other names a secret.
#[test]
fn job_with_the_key_has_neither_sources_nor_tools_and_runs_for_tags_that_passed_everything() {
    let words = WORKFLOWS.map(|workflow| workflow.matches("secrets").count());
    assert_eq!(words, [1, 0], "the word stands once, in the job that signs");
    let all: Value = serde_yaml_ng::from_str(WORKFLOWS[0]).unwrap();
    let mut job = all["jobs"]["sign"].as_mapping().unwrap().clone();
    let Some(Value::Sequence(steps)) = job.remove("steps") else {
        panic!("sign has no steps");
    };
    let rest: Value = serde_yaml_ng::from_str(
        "
        name: Signatures of a release
        needs: [all, files, rebuild]
        if: >-
          github.ref_type == 'tag' && !cancelled() && needs.all.result == 'success' && needs.files.result == 'success'
          && needs.rebuild.result == 'success'
        runs-on: ubuntu-24.04
        timeout-minutes: 10
        environment: release
        permissions: {}
        ",
    )
    .unwrap();
    assert_eq!(Value::Mapping(job), rest);
    let [download, sign, upload] = &steps[..] else {
        panic!("sign has {} steps", steps.len());
    };
    for (step, action) in [(download, "download"), (upload, "upload")] {
        let uses = step["uses"].as_str().unwrap();
        assert!(
            uses.starts_with(&format!("actions/{action}-artifact@")),
            "{uses}"
        );
        assert!(step.get("env").is_none(), "{step:?}");
    }
    assert_eq!(
        sign["env"]["MODIO_SIGNING_KEY"],
        "${{ secrets.MODIO_SIGNING_KEY }}"
    );
    // The script starts only these programs, and so no file of the artifact.
    let commands = [
        "set",
        "export",
        "umask",
        "mkdir",
        "cd",
        "diff",
        "sha256sum",
        "field()",
        "for",
        "echo",
        "test",
        "openssl",
        "-out",
        "done",
        "#",
    ];
    for line in script().lines() {
        let first = line.split_whitespace().next().unwrap();
        assert!(commands.contains(&first), "{line}");
    }
}

/// Returns the script of the job that signs.
fn script() -> String {
    let Workflow { jobs, .. } = serde_yaml_ng::from_str(WORKFLOWS[0]).unwrap();
    let scripts = jobs["sign"].steps.iter().filter_map(|step| step.get("run"));
    let scripts: Vec<_> = scripts.filter_map(|script| script.as_str()).collect();
    assert_eq!(scripts.len(), 1);
    scripts[0].to_owned()
}

/// With the programs of the machine that signs: other systems have others.
#[cfg(target_os = "linux")]
mod signing {
    use std::process::Command;

    use ed25519_dalek::{Signer as _, SigningKey};

    use super::*;

    /// Runs the script in a directory with these bytes to be signed, and with a file that is in no list. Returns the
    /// signature.
    fn signed(part: &[u8], sums: Option<&str>, other: Option<&str>, key: &str) -> Option<Vec<u8>> {
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
        if let Some(other) = other {
            write(other, part);
        }
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

    #[test]
    fn workflow_signs_as_xtask_does_and_refuses_what_is_not_expected() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("key");
        crate::keys::generate(&path).unwrap();
        let pem = std::fs::read_to_string(&path).unwrap();
        let key: SigningKey = crate::keys::private(&pem).unwrap();
        let right = part();
        let signature = signed(&right, None, None, &pem).expect("openssl signs");
        assert_eq!(signature, key.sign(&right).to_bytes());
        let changed = |at: usize| {
            let mut part = part();
            part[at] ^= 1;
            part
        };
        for (what, part, sums, other) in [
            ("another magic number", changed(0), None, None),
            ("another version of the header", changed(4), None, None),
            ("another epoch", changed(6), None, None),
            ("another length", part()[..91].to_vec(), None, None),
            (
                "other check sums",
                part(),
                Some("0000  modio-02-a.tbs"),
                None,
            ),
            ("a file in no list", part(), None, Some("modio-02-b.tbs")),
        ] {
            assert_eq!(signed(&part, sums, other, &pem), None, "{what}");
        }
    }
}
