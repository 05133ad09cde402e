//! `cargo xtask peers`: well-known Modbus servers with the standard cases of the conformance suite, as a table in
//! docs/conformance.md. tools/peers has a small host program for each; the line is a pair of pseudo-terminals.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, bail, ensure};
use fs_err as fs;
use serde_json::Value;

use crate::command;
use crate::workspace::{self, MESSAGES, Workspace};

mod server;
#[cfg(all(test, unix))]
mod tests;

use server::{Peer, Prepared, Started};

/// The servers' package, a separate workspace.
pub const MANIFEST: &str = "tools/peers/Cargo.toml";

/// The configuration of every server.
const PROFILE: &str = "tools/peers/profile.toml";

/// The document with the table, and the lines before and after the table.
const DOCUMENT: &str = "docs/conformance.md";
const BEGIN: &str = "<!-- `cargo xtask peers` writes from here -->\n";
const END: &str = "<!-- to here -->\n";

/// The case that `cargo xtask ci` runs on every server. It reads 125 registers.
const SMOKE: &str = "fc03/quantity-most";

/// The options of `cargo xtask peers`.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// Test only this server, print its row, and do not write the document; may be repeated
    #[arg(long, value_name = "NAME")]
    only: Vec<Peer>,

    /// Write what every server sent and received, and every failed case, to files in this directory
    #[arg(long, value_name = "DIR")]
    traces: Option<PathBuf>,
}

/// `cargo xtask peers`. A server whose library is missing is left out of the table, with the reason after it.
pub fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    let programs = Programs::build(workspace)?;
    let mut table =
        "| server | version | passed | failed | could not be asked | failed cases by group |\n\
                     |---|---|---|---|---|---|\n"
            .to_owned();
    let mut missing = String::new();
    for &peer in Peer::ALL {
        if !options.only.is_empty() && !options.only.contains(&peer) {
            continue;
        }
        let name = peer.name();
        eprintln!("testing {name}, which takes minutes");
        match peer.prepare(workspace, programs.built()) {
            Ok(server) => {
                let cases = ["--standard-only", "--trace"];
                let report = programs.test(&server, &cases, options.traces.as_deref())?;
                table += &row(&server, &report)?;
            }
            Err(why) => missing += &format!("\nLeft out: {name}: {why:#}.\n"),
        }
    }
    let table = table + &missing;
    say!("{}", table.trim_end());
    if options.only.is_empty() {
        let path = workspace.root().join(DOCUMENT);
        let document = replaced(&fs::read_to_string(&path)?, &table);
        fs::write(
            &path,
            document.with_context(|| format!("{DOCUMENT} has no {BEGIN:?} with {END:?}"))?,
        )?;
    }
    Ok(())
}

/// Builds every server, and reads registers of each.
pub fn check(workspace: &Workspace) -> Result<()> {
    let programs = Programs::build(workspace)?;
    for peer in Peer::ALL {
        let server = peer.prepare(workspace, programs.built())?;
        let report = programs.test(&server, &["--only", SMOKE], None)?;
        let cases = report["cases"].as_array().into_iter().flatten();
        let passed = cases.filter(|case| case["result"] == "passed").count();
        ensure!(passed > 0, "{} does not pass {SMOKE}", peer.name());
    }
    Ok(())
}

/// The programs of a test.
struct Programs {
    /// Joins two pseudo-terminals.
    line: PathBuf,
    suite: PathBuf,
    profile: PathBuf,
    /// Directory of the reports.
    scratch: PathBuf,
}

impl Programs {
    fn build(workspace: &Workspace) -> Result<Self> {
        let scratch = server::directory(workspace);
        let mut cargo = workspace.cargo("build");
        cargo.args(["--quiet", "--locked", "--manifest-path", MANIFEST, MESSAGES]);
        let artifacts = workspace::artifacts(cargo.arg("--target-dir").arg(&scratch))?;
        Ok(Self {
            line: workspace::executable(&artifacts, "peer-line")?,
            suite: workspace.program("modio-conformance")?,
            profile: workspace.root().join(PROFILE),
            scratch,
        })
    }

    /// Returns the directory of the servers in Rust.
    fn built(&self) -> &Path {
        self.line.parent().unwrap_or(&self.line)
    }

    /// Starts a server on a new line, runs these cases against it, and returns the suite's report.
    fn test(&self, server: &Prepared, cases: &[&str], traces: Option<&Path>) -> Result<Value> {
        let name = server.name;
        let mut line = Started::new(Command::new(&self.line))?;
        let [port, other] = [line.line()?, line.line()?];
        let mut program = Command::new(&server.program);
        program.args(&server.arguments).arg(port);
        let mut running = Started::new(program)?;
        let ready = running.line()?;
        ensure!(ready == "ready", "{name} does not start: {ready}");
        let json = self.scratch.join(format!("{name}.json"));
        let mut suite = Command::new(&self.suite);
        suite.arg("--serial").arg(other);
        suite.args(["--baud", "19200", "--format", "8N2", "--profile"]);
        suite
            .arg(&self.profile)
            .args(cases)
            .arg("--json")
            .arg(&json);
        let output = command::output(&mut suite)?;
        if let Some(directory) = traces {
            fs::create_dir_all(directory)?;
            fs::write(directory.join(format!("{name}.cases")), &output.stdout)?;
            fs::write(directory.join(format!("{name}.trace")), &output.stderr)?;
        }
        // 0: all cases passed, 1: cases failed.
        if !matches!(output.status.code(), Some(0 | 1)) {
            bail!("{name} cannot be tested: {}", command::complaint(&output));
        }
        if let Some(status) = running.ended() {
            bail!("{name} has ended during the test ({status})");
        }
        let report = serde_json::from_str(&fs::read_to_string(&json)?);
        report.with_context(|| json.display().to_string())
    }
}

/// Returns the row of a server in the table, from the suite's report.
fn row(server: &Prepared, report: &Value) -> Result<String> {
    let (mut passed, mut failed, mut skipped) = (0, 0, 0);
    // Groups of cases with the number of those that failed, in the order of the suite.
    let mut groups: Vec<(&str, usize)> = Vec::new();
    for case in report["cases"]
        .as_array()
        .context("modio-conformance reports no cases")?
    {
        match case["result"].as_str() {
            Some("passed") => passed += 1,
            Some("skipped") => skipped += 1,
            _ => {
                failed += 1;
                let group = case["name"]
                    .as_str()
                    .and_then(|name| name.split('/').next());
                let group = group.unwrap_or_default();
                match groups.iter_mut().find(|(name, _)| *name == group) {
                    Some((_, count)) => *count += 1,
                    None => groups.push((group, 1)),
                }
            }
        }
    }
    let groups = groups
        .iter()
        .map(|(name, count)| format!("`{name}` {count}"));
    let groups = groups.collect::<Vec<_>>().join(", ");
    let Prepared { name, version, .. } = server;
    Ok(format!(
        "| {name} | {version} | {passed} | {failed} | {skipped} | {groups} |\n"
    ))
}

/// Returns the document with the table replaced.
fn replaced(document: &str, table: &str) -> Option<String> {
    let (before, rest) = document.split_once(BEGIN)?;
    let (_, after) = rest.split_once(END)?;
    Some(format!("{before}{BEGIN}{table}{END}{after}"))
}
