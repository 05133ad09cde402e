//! What is done to the board in which order, with scripts in the place of the programs.

use std::fs;

use clap::Parser;

use super::*;
use crate::script::program;

#[derive(Parser)]
struct Cli {
    #[command(flatten)]
    options: Options,
}

fn options(arguments: &[&str]) -> Options {
    let all = ["hil", "--port", "/dev/line"].iter().chain(arguments);
    Cli::try_parse_from(all).unwrap().options
}

/// A directory with a tester that writes its arguments down and ends as the script says.
struct Fake(tempfile::TempDir);

impl Fake {
    fn new(script: &str) -> Self {
        let fake = Self(tempfile::tempdir().unwrap());
        let log = fake.at("log");
        let text = format!("echo \"test $*\" >> '{}'\n{script}", log.display());
        program(fake.0.path(), "tester", &text);
        fake
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn note(&self, line: &str) -> String {
        format!("echo {line} >> '{}'", self.at("log").display())
    }

    /// Prepares, and runs the test; gives what was done.
    fn run(&self, options: &Options, written: Result<()>) -> (Vec<String>, Result<()>) {
        let write = || {
            command::run(&mut shell(&self.note("write")))?;
            written
        };
        let ended = options
            .prepare(&self.at("tester"), write)
            .and_then(|mut test| command::run(&mut test));
        let log = fs::read_to_string(self.at("log")).unwrap_or_default();
        (log.lines().map(str::to_owned).collect(), ended)
    }
}

#[test]
fn it_is_checked_then_written_then_reset_then_tested() {
    let fake = Fake::new("");
    let reset = fake.note("reset");
    let arguments = [
        "--flash",
        "--unit",
        "9",
        "--rates",
        "all",
        "--reset-cmd",
        &reset,
    ];
    let (done, ended) = fake.run(&options(&arguments), Ok(()));
    assert_eq!(ended, Ok(()));
    assert_eq!(
        done,
        [
            "test --port /dev/line --unit 9 --rates all --check",
            "write",
            "reset",
            "test --port /dev/line --unit 9 --rates all",
        ]
    );
}

#[test]
fn a_board_that_nothing_is_done_to_is_tested_at_once() {
    let fake = Fake::new("");
    let (done, _) = fake.run(&options(&["--no-suite", "--json", "x y"]), Ok(()));
    assert_eq!(done, ["test --port /dev/line --json x y --no-suite"]);
}

#[test]
fn a_mistake_is_told_before_the_board_is_touched() {
    let fake = Fake::new("echo 'modio-hil: /dev/line is not there' >&2; exit 2");
    let (done, ended) = fake.run(&options(&["--flash"]), Ok(()));
    let failure = ended.unwrap_err();
    assert_eq!(failure.to_string(), "/dev/line is not there");
    assert_eq!((failure.code, done.len()), (2, 1), "{done:?}");
}

#[test]
fn what_cannot_be_written_or_reset_is_not_tested() {
    let fake = Fake::new("");
    let (done, ended) = fake.run(&options(&["--flash"]), Err(Failure::new("no probe")));
    assert_eq!(ended.unwrap_err().to_string(), "no probe");
    assert_eq!(done.last().unwrap(), "write");

    let (done, ended) = fake.run(&options(&["--reset-cmd", "exit 3"]), Ok(()));
    let text = ended.unwrap_err().to_string();
    assert!(text.contains("exit 3") && text.contains("failed"), "{text}");
    assert!(done.last().unwrap().ends_with("--check"), "{done:?}");
}

#[test]
fn a_probe_without_anything_to_write_is_a_mistake() {
    let mut workspace = Workspace::open().unwrap();
    for told in [["--probe", "0483:3748"], ["--elf", "x"]] {
        let failure = run(&mut workspace, &options(&told)).unwrap_err();
        assert!(failure.to_string().contains("--flash"), "{failure}");
        assert_eq!(failure.code, 2);
    }
}

#[test]
fn every_option_is_one_that_the_tester_has() {
    let options = options(&[
        "--baud",
        "9600",
        "--format",
        "8N1",
        "--allow-config",
        "--only",
        "a",
        "--only",
        "b",
        "--requests",
        "5",
        "--limit",
        "9",
        "--fixture",
        "f",
        "--patience",
        "7",
        "--junit",
        "j",
    ]);
    let root = Workspace::open().unwrap().root().to_owned();
    let source = root.join("tools/conformance/src");
    let tester = ["hil/cli.rs", "program.rs"]
        .map(|file| fs::read_to_string(source.join(file)).unwrap())
        .concat();
    let arguments = options.arguments();
    let names = arguments
        .iter()
        .filter_map(|a| a.to_str()?.strip_prefix("--"));
    assert_eq!(names.clone().count(), 11);
    for name in names {
        let field = format!("    pub {}: ", name.replace('-', "_"));
        assert!(tester.contains(&field), "{name}");
    }
}
