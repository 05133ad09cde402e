//! The command with scripts in the place of line, server and suite.

use serde_json::json;

use super::server::{libmodbus, locked_version};
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

struct Fake {
    directory: tempfile::TempDir,
    programs: Programs,
}

impl Fake {
    fn new(line: &str, server: &str, suite: &str) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let at = directory.path();
        program(at, "server", server);
        let programs = Programs {
            line: program(at, "line", line),
            suite: program(at, "suite", suite),
            profile: "profile.toml".into(),
            scratch: at.to_owned(),
        };
        Self {
            directory,
            programs,
        }
    }

    fn test(&self) -> Result<Value> {
        let options = Options {
            only: Vec::new(),
            traces: Some(self.directory.path().join("traces")),
        };
        let server = [self.directory.path().join("server")];
        self.programs
            .test(&server, &["--standard-only"], "fake", &options)
    }
}

#[test]
fn suite_is_run_on_the_other_end_of_the_servers_line_and_its_report_is_returned() {
    let fake = Fake::new(LINE, SERVER, SUITE);
    let report = fake.test().unwrap();
    assert_eq!(Row::new("fake", "1", &report).unwrap().passed, 1);
    let traces = fake.directory.path().join("traces");
    let arguments = fs::read_to_string(traces.join("fake.cases")).unwrap();
    let wanted =
        "--serial /dev/b --baud 19200 --format 8N2 --profile profile.toml --standard-only --json ";
    assert!(arguments.starts_with(wanted), "{arguments}");
    let trace = fs::read_to_string(traces.join("fake.trace")).unwrap();
    assert_eq!(trace, "traced\n");
}

#[test]
fn server_that_does_not_start_or_ends_or_cannot_be_tested_is_an_error() {
    for (line, server, suite, wrong) in [
        (
            LINE,
            "echo no such port; cat",
            SUITE,
            "fake does not start: no such port",
        ),
        (LINE, "exit 0", SUITE, "has ended at its start"),
        ("exit 0", SERVER, SUITE, "has ended at its start"),
        (
            LINE,
            "echo ready",
            &format!("sleep 1\n{SUITE}"),
            "fake has ended while",
        ),
        (
            LINE,
            SERVER,
            "echo 'modio-conformance: silent' >&2; exit 2",
            "silent",
        ),
    ] {
        let told = Fake::new(line, server, suite)
            .test()
            .unwrap_err()
            .to_string();
        assert!(told.contains(wrong), "{told}");
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
    let row = Row::new("libother", "1.2", &report).unwrap();
    let text = table::text(&[row], &["libmodbus: not here".to_owned()]);
    let lines: Vec<&str> = text.lines().skip(2).collect();
    assert_eq!(
        lines[0],
        "| libother | 1.2 | 1 | 3 | 1 | `fc01` 1, `fc05` 2 |"
    );
    assert_eq!(lines[2], "Left out: libmodbus: not here.");
    assert!(Row::new("x", "1", &json!({})).is_err());
}

#[test]
fn table_is_replaced_between_its_marks_in_the_document() {
    let workspace = Workspace::open().unwrap();
    let document = fs::read_to_string(workspace.root().join(DOCUMENT)).unwrap();
    let new = table::replaced(&document, "a table\n").expect("the document has a place for it");
    assert!(new.contains("-->\na table\n<!--"));
    assert_eq!(table::replaced(&new, "a table\n"), Some(new));
    assert_eq!(table::replaced("no marks", "a table\n"), None);
}

#[test]
fn document_has_the_versions_that_are_locked() {
    let workspace = Workspace::open().unwrap();
    let root = workspace.root();
    let document = fs::read_to_string(root.join(DOCUMENT)).unwrap();
    let lock = fs::read_to_string(root.join("tools/peers/Cargo.lock")).unwrap();
    let python = root.join("tools/sim/tests/pymodbus/requirements.txt");
    let python = fs::read_to_string(python).unwrap();
    let pinned = python
        .lines()
        .find_map(|line| line.strip_prefix("pymodbus=="));
    for (name, version) in [
        ("modbus-core", locked_version(&lock, "modbus-core").unwrap()),
        ("rmodbus", locked_version(&lock, "rmodbus").unwrap()),
        ("pymodbus", pinned.unwrap().to_owned()),
    ] {
        let row = format!("| {name} | {version} |");
        assert!(document.contains(&row), "{row}: run `cargo xtask peers`");
    }
}

#[test]
fn missing_libmodbus_is_reported_with_what_to_install() {
    let workspace = Workspace::open().unwrap();
    let told = libmodbus(&workspace, "no-pkg-config-here").unwrap_err();
    assert!(told.to_string().contains("apt-get install"), "{told}");
}
