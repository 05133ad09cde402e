//! Tests of the command with scripts in place of line, server and suite.

use serde_json::json;

use super::*;
use crate::script::program;

const LINE: &str = "echo /dev/a; echo /dev/b; cat";
const SERVER: &str = "echo ready; cat";
/// Writes its arguments, and a report to the file after `--json`.
const SUITE: &str = r#"
    echo "$*"; echo traced >&2
    while [ "$1" != --json ]; do shift; done
    echo '{"cases": [{"name": "fc01/data", "result": "passed"}]}' > "$2"
    exit 1"#;

fn prepared(program: PathBuf) -> Prepared {
    Prepared {
        name: "fake",
        version: "1.2".to_owned(),
        program,
        arguments: Vec::new(),
    }
}

/// Runs a test of these scripts, with traces in `traces` of the directory.
fn test(directory: &Path, line: &str, server: &str, suite: &str) -> Result<Value> {
    let programs = Programs {
        line: program(directory, "line", line),
        suite: program(directory, "suite", suite),
        profile: "profile.toml".into(),
        scratch: directory.to_owned(),
    };
    let server = prepared(program(directory, "server", server));
    programs.test(
        &server,
        &["--standard-only"],
        Some(&directory.join("traces")),
    )
}

#[test]
fn suite_runs_on_the_other_end_of_the_servers_line() {
    let directory = tempfile::tempdir().unwrap();
    let report = test(directory.path(), LINE, SERVER, SUITE).unwrap();
    assert_eq!(report["cases"][0]["name"], "fc01/data");
    let trace = |name| fs::read_to_string(directory.path().join("traces").join(name)).unwrap();
    let wanted =
        "--serial /dev/b --baud 19200 --format 8N2 --profile profile.toml --standard-only --json ";
    assert!(trace("fake.cases").starts_with(wanted));
    assert_eq!(trace("fake.trace"), "traced\n");
}

#[test]
fn server_that_does_not_start_or_ends_or_cannot_be_tested_is_an_error() {
    let dies = format!("sleep 1\n{SUITE}");
    let silent = "echo 'modio-conformance: silent' >&2; exit 2";
    for (line, server, suite, wrong) in [
        (
            LINE,
            "echo no such port; cat",
            SUITE,
            "fake does not start: no such port",
        ),
        (LINE, "exit 0", SUITE, "has ended at its start"),
        ("exit 0", SERVER, SUITE, "has ended at its start"),
        (LINE, "echo ready", &dies, "fake has ended during the test"),
        (LINE, SERVER, silent, "silent"),
    ] {
        let directory = tempfile::tempdir().unwrap();
        let error = test(directory.path(), line, server, suite).unwrap_err();
        assert!(error.to_string().contains(wrong), "{error}");
    }
}

#[test]
fn failures_are_counted_by_group() {
    let case = |name: &str, result: &str| json!({ "name": name, "result": result });
    let report = json!({ "cases": [
        case("fc01/data", "passed"),
        case("fc01/length", "failed"),
        case("fc05/value", "failed"),
        case("fc05/address", "failed"),
        case("power/answers", "skipped"),
    ] });
    let server = prepared("server".into());
    let row = row(&server, &report).unwrap();
    assert_eq!(row, "| fake | 1.2 | 1 | 3 | 1 | `fc01` 1, `fc05` 2 |\n");
    assert!(super::row(&server, &json!({})).is_err());
}

#[test]
fn document_has_a_place_for_the_table_and_the_locked_versions() {
    let workspace = Workspace::open().unwrap();
    let root = workspace.root();
    let document = fs::read_to_string(root.join(DOCUMENT)).unwrap();
    let new = replaced(&document, "a table\n").unwrap();
    assert!(new.contains("-->\na table\n<!--"));
    let lock = root.join("tools/peers/Cargo.lock");
    let python = fs::read_to_string(crate::pymodbus::requirements(&workspace)).unwrap();
    let mut pinned = python
        .lines()
        .filter_map(|line| line.strip_prefix("pymodbus=="));
    for (name, version) in [
        (
            "modbus-core",
            server::locked_version(&lock, "modbus-core").unwrap(),
        ),
        ("rmodbus", server::locked_version(&lock, "rmodbus").unwrap()),
        ("pymodbus", pinned.next().unwrap().to_owned()),
    ] {
        let row = format!("| {name} | {version} |");
        assert!(document.contains(&row), "{row}: run `cargo xtask peers`");
    }
}
