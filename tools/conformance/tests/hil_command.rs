//! What the command does to a board before the tests, and in which order. Scripts replace the other programs.

#![cfg(unix)]

use std::fs;
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt as _;
use std::path::PathBuf;
use std::process::{Command, Output};

/// A directory with a log of what was done, and a `cargo` that writes its arguments to the log.
struct Fake {
    directory: tempfile::TempDir,
    line: TcpListener,
}

impl Fake {
    fn new(cargo: &str) -> Self {
        let fake = Self {
            directory: tempfile::tempdir().unwrap(),
            line: TcpListener::bind("127.0.0.1:0").unwrap(),
        };
        let script = format!(
            "#!/bin/sh\necho \"$@\" >> '{}'\n{cargo}\n",
            fake.at("log").display()
        );
        fs::write(fake.at("cargo"), script).unwrap();
        fs::set_permissions(fake.at("cargo"), fs::Permissions::from_mode(0o755)).unwrap();
        fake
    }

    fn at(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    /// A shell command that writes a line to the log.
    fn note(&self, line: &str) -> String {
        format!("echo {line} >> '{}'", self.at("log").display())
    }

    fn log(&self) -> Vec<String> {
        let log = fs::read_to_string(self.at("log")).unwrap_or_default();
        log.lines().map(str::to_owned).collect()
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let line = self.line.local_addr().unwrap().to_string();
        Command::new(env!("CARGO_BIN_EXE_modio-conformance"))
            .env("CARGO", self.at("cargo"))
            .args(["hil", "--tcp", &line, "--patience", "10"])
            .args(arguments)
            .output()
            .unwrap()
    }
}

fn complaint(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn image_is_written_then_the_board_is_reset_then_tested() {
    let fake = Fake::new("");
    let reset = fake.note("reset");
    let arguments = ["--flash", "--probe=1:2", "--elf=x", "--reset-cmd", &reset];
    let output = fake.run(&arguments);
    assert_eq!(fake.log(), ["xtask flash --probe 1:2 --elf x", "reset"]);
    let error = complaint(&output);
    assert!(error.contains("unit 1 does not answer"), "{error}");
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn bench_file_gives_probe_and_reset_command_and_nothing_is_written_without_flash() {
    let fake = Fake::new("");
    let file = fake.at("bench.toml");
    let reset = fake.note("reset").replace('"', "'");
    fs::write(&file, format!("probe = \"3:4\"\nreset_cmd = \"{reset}\"\n")).unwrap();
    let file = file.to_string_lossy();
    fake.run(&["--bench", &file, "--flash"]);
    assert_eq!(fake.log(), ["xtask flash --probe 3:4", "reset"]);
    fake.run(&["--bench", &file]);
    assert_eq!(fake.log().len(), 3, "reset only");
}

#[test]
fn wrong_argument_is_reported_before_anything_is_done_to_the_board() {
    let fake = Fake::new("");
    let file = fake.at("bench.toml");
    fs::write(&file, "unit = 1\nwires = 3\n").unwrap();
    let file = file.to_string_lossy();
    for (arguments, wrong) in [
        (&["--only", "no such case"][..], "no case has such a name"),
        (&["--bench", &file], "bench.toml:2: unknown field `wires`"),
        (&["--json", "/nowhere/x"], "cannot write /nowhere/x"),
        (&["--format", "7E1"], "RTU needs 8 data bits"),
        (&["--no-suite", "--requests", "0"], "nothing to test"),
    ] {
        let output = fake.run(&[&["--flash", "--reset-cmd", "false"], arguments].concat());
        let error = complaint(&output);
        assert!(
            error.contains(wrong) && error.lines().count() == 1,
            "{error}"
        );
        assert_eq!((output.status.code(), fake.log().len()), (Some(2), 0));
    }
}

#[test]
fn board_that_cannot_be_written_or_reset_is_not_tested() {
    let fake = Fake::new("exit 3");
    let reset = fake.note("reset");
    let output = fake.run(&["--flash", "--reset-cmd", &reset]);
    assert!(complaint(&output).contains("`cargo xtask flash` failed"));
    assert_eq!((output.status.code(), fake.log().len()), (Some(2), 1));

    let fake = Fake::new("");
    let output = fake.run(&["--reset-cmd", "exit 3"]);
    let error = complaint(&output);
    assert!(error.contains("`exit 3` failed"), "{error}");
    assert!(!error.contains("does not answer"), "{error}");
}
