//! `cargo xtask peers`: well-known Modbus servers under the standard cases of the conformance suite, as a table in
//! docs/conformance.md. tools/peers has a small host program for each; the line is a pair of pseudo-terminals.

mod server;
mod table;
#[cfg(all(test, unix))]
mod tests;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use serde_json::Value;

use crate::steps::Outcome;
use crate::workspace::Workspace;
use crate::{Failure, Result, command};
use server::{Peer, Started};
use table::Row;

/// The servers' package, a workspace of its own.
pub const MANIFEST: &str = "tools/peers/Cargo.toml";

/// What every server is configured to have.
const PROFILE: &str = "tools/peers/profile.toml";

/// The document with the table.
const DOCUMENT: &str = "docs/conformance.md";

/// The case that `cargo xtask ci` tries on every server: 125 registers are read.
const SMOKE: &str = "fc03/quantity-most";

/// Time in which a program has to be ready. Python takes seconds on a busy machine.
const START: Duration = Duration::from_secs(60);

/// The options of `cargo xtask peers`.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// Test only this server, print its row, and leave the document alone; may be repeated
    #[arg(long, value_name = "NAME", value_parser = ["libmodbus", "modbus-core", "pymodbus", "rmodbus"])]
    only: Vec<String>,

    /// Write what every server sent and received, and every failed case, to files in this directory
    #[arg(long, value_name = "DIR")]
    traces: Option<PathBuf>,
}

/// `cargo xtask peers`.
///
/// # Errors
///
/// When the suite or the servers do not build, a server does not start, or the document cannot be written. A
/// server whose library is missing is left out of the table, with the reason below it.
pub fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    let programs = Programs::build(workspace)?;
    let mut rows = Vec::new();
    let mut missing = Vec::new();
    for peer in Peer::ALL {
        let name = peer.name();
        if !options.only.is_empty() && !options.only.iter().any(|only| only == name) {
            continue;
        }
        eprintln!("testing {name}, which takes minutes");
        match peer.prepare(workspace) {
            Ok(prepared) => {
                let cases = ["--standard-only", "--trace"];
                let report = programs.test(&prepared.command, &cases, name, options)?;
                rows.push(Row::new(name, &prepared.version, &report)?);
            }
            Err(why) => {
                eprintln!("{name} is left out: {why}");
                missing.push(format!("{name}: {why}"));
            }
        }
    }
    let text = table::text(&rows, &missing);
    say!("{}", text.trim_end());
    if options.only.is_empty() {
        table::replace_in(&workspace.root().join(DOCUMENT), &text)?;
    }
    Ok(())
}

/// Builds every server, and reads registers of each; part of `cargo xtask ci`.
pub fn step(workspace: &Workspace) -> Outcome {
    let options = Options {
        only: Vec::new(),
        traces: None,
    };
    let tried = Programs::build(workspace).and_then(|programs| {
        for peer in Peer::ALL {
            let prepared = peer.prepare(workspace)?;
            let cases = ["--only", SMOKE];
            let report = programs.test(&prepared.command, &cases, peer.name(), &options)?;
            let row = Row::new(peer.name(), &prepared.version, &report)?;
            if row.passed == 0 {
                let what = format!("{} does not pass {SMOKE}", peer.name());
                return Err(Failure::new(what));
            }
        }
        Ok(())
    });
    tried.into()
}

/// The programs that a test takes.
struct Programs {
    /// Joins two pseudo-terminals.
    line: PathBuf,
    suite: PathBuf,
    profile: PathBuf,
    /// Where reports are kept for the time of a run.
    scratch: PathBuf,
}

impl Programs {
    fn build(workspace: &Workspace) -> Result<Self> {
        command::run(workspace.cargo("build").args([
            "--quiet",
            "--package",
            "conformance",
            "--bin",
            "modio-conformance",
        ]))?;
        let peers = server::directory(workspace);
        let mut cargo = workspace.cargo("build");
        cargo.args(["--quiet", "--locked", "--manifest-path", MANIFEST]);
        command::run(cargo.arg("--target-dir").arg(&peers))?;
        Ok(Self {
            line: peers.join("debug/peer-line"),
            suite: workspace.target().join("debug/modio-conformance"),
            profile: workspace.root().join(PROFILE),
            scratch: peers,
        })
    }

    /// Starts a server on a line of its own and runs these cases against it; returns the suite's report.
    fn test(
        &self,
        server: &[PathBuf],
        cases: &[&str],
        name: &str,
        options: &Options,
    ) -> Result<Value> {
        let mut line = Started::new(&mut Command::new(&self.line), START)?;
        let [port, other] = [line.line()?, line.line()?];
        let [program, arguments @ ..] = server else {
            return Err(Failure::new(format!("{name} has no program")));
        };
        let mut server = Started::new(Command::new(program).args(arguments).arg(port), START)?;
        let ready = server.line()?;
        if ready != "ready" {
            return Err(Failure::new(format!("{name} does not start: {ready}")));
        }
        let json = self.scratch.join(format!("{name}.json"));
        let mut suite = Command::new(&self.suite);
        suite.arg("--serial").arg(other);
        suite.args(["--baud", "19200", "--format", "8N2", "--profile"]);
        suite
            .arg(&self.profile)
            .args(cases)
            .arg("--json")
            .arg(&json);
        let output = suite
            .output()
            .map_err(|error| Failure::new(format!("modio-conformance cannot be run: {error}")))?;
        if let Some(directory) = &options.traces {
            for (kind, bytes) in [("cases", &output.stdout), ("trace", &output.stderr)] {
                write(&directory.join(format!("{name}.{kind}")), bytes)?;
            }
        }
        // 0 and 1 are verdicts.
        if !matches!(output.status.code(), Some(0 | 1)) {
            let why = command::complaint(&output);
            return Err(Failure::new(format!("{name} cannot be tested: {why}")));
        }
        if let Some(status) = server.ended() {
            let what = format!("{name} has ended while it was tested ({status})");
            return Err(Failure::new(what));
        }
        read_report(&json)
    }
}

fn read_report(path: &Path) -> Result<Value> {
    let told = |why: String| Failure::new(format!("{}: {why}", path.display()));
    let text = fs::read_to_string(path).map_err(|error| told(error.to_string()))?;
    serde_json::from_str(&text).map_err(|error| told(error.to_string()))
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let made = path.parent().map_or(Ok(()), fs::create_dir_all);
    made.and_then(|()| fs::write(path, bytes))
        .map_err(|error| Failure::new(format!("cannot write {}: {error}", path.display())))
}
