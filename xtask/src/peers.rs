//! `cargo xtask peers`: well-known Modbus servers with the standard cases of the conformance suite, as a table in
//! docs/conformance.md. tools/peers has a small host program for each; the line is a pair of pseudo-terminals.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, bail, ensure};
use fs_err as fs;
use serde_json::Value;

use crate::group::Group;
use crate::workspace::{self, Workspace, locked};
use crate::{command, python};

/// The servers' package, a separate workspace.
pub const MANIFEST: &str = "tools/peers/Cargo.toml";

/// The configuration of every server.
const PROFILE: &str = "tools/peers/profile.toml";

/// The document with the table, and the lines before and after the table.
const DOCUMENT: &str = "docs/conformance.md";
const BEGIN: &str = "<!-- `cargo xtask peers` writes from here -->\n";
const END: &str = "<!-- to here -->\n";

const HEADINGS: &str = "\
| server | version | passed | failed | could not be asked | failed cases by group |
|---|---|---|---|---|---|
";

/// The servers, in the order of the table.
const PEERS: [&str; 4] = ["libmodbus", "modbus-core", "pymodbus", "rmodbus"];

/// The case that `cargo xtask ci` runs on every server. It reads 125 registers.
const SMOKE: &str = "fc03/quantity-most";

/// The options of `cargo xtask peers`.
#[derive(clap::Args, Debug)]
pub struct Options {
    /// Test only this server, print its row, and do not write the document; may be repeated
    #[arg(long, value_name = "NAME", value_parser = PEERS)]
    only: Vec<String>,

    /// Write what every server sent and received, and every failed case, to files in this directory
    #[arg(long, value_name = "DIR")]
    traces: Option<PathBuf>,
}

/// `cargo xtask peers`. A server whose library is missing is left out of the table, with the reason after it.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let programs = Programs::build(workspace)?;
    let mut table = HEADINGS.to_owned();
    let mut left_out = String::new();
    let all = options.only.is_empty();
    let wanted = |name: &&str| all || options.only.iter().any(|only| only == name);
    for name in PEERS.into_iter().filter(wanted) {
        eprintln!("testing {name}, which takes minutes");
        match programs.server(name) {
            Ok((server, version)) => {
                let cases = ["--standard-only", "--trace"];
                let report = programs.test(name, server, &cases, options.traces.as_deref())?;
                table += &row(name, version.trim(), &report);
            }
            Err(why) => left_out += &format!("\nLeft out: {name}: {why:#}.\n"),
        }
    }
    table += &left_out;
    say!("{}", table.trim_end());
    if all {
        let path = workspace.root.join(DOCUMENT);
        let document = replaced(&fs::read_to_string(&path)?, &table);
        let document =
            document.with_context(|| format!("{DOCUMENT} has no {BEGIN:?} with {END:?}"))?;
        fs::write(&path, document)?;
    }
    Ok(())
}

/// Builds every server, and reads registers of each.
pub fn check(workspace: &mut Workspace) -> Result<()> {
    let programs = Programs::build(workspace)?;
    for name in PEERS {
        let (server, _) = programs.server(name)?;
        let report = programs.test(name, server, &["--only", SMOKE], None)?;
        ensure!(report["passed"] == 1, "{name} does not pass {SMOKE}");
    }
    Ok(())
}

struct Programs<'a> {
    workspace: &'a Workspace,
    /// Joins two pseudo-terminals.
    line: PathBuf,
    suite: PathBuf,
}

impl<'a> Programs<'a> {
    fn build(workspace: &'a Workspace) -> Result<Self> {
        let mut cargo = workspace.other("build", MANIFEST, "peers");
        let artifacts = workspace::artifacts(cargo.arg("--quiet"))?;
        Ok(Self {
            workspace,
            line: workspace::executable(&artifacts, "peer-line")?,
            suite: workspace.program("modio-conformance")?,
        })
    }

    /// Prepares a server. Returns its program, to which the port is the last argument, and the version of its library.
    fn server(&self, name: &str) -> Result<(Command, String)> {
        let peers = self.workspace.root.join("tools/peers");
        // Those in Rust have been built with the line.
        let mut program = self.line.with_file_name(format!("peer-{name}"));
        match name {
            "libmodbus" => {
                let mut pkg_config = Command::new("pkg-config");
                pkg_config.args(["--cflags", "--libs", "libmodbus"]);
                let flags = command::read(&mut pkg_config).context(
                    "libmodbus is not installed (on Debian: apt-get install gcc pkg-config libmodbus-dev)",
                )?;
                let mut cc = Command::new("cc");
                cc.args(["-Wall", "-Wextra", "-Werror", "-o"]).arg(&program);
                cc.arg(peers.join("libmodbus.c"));
                command::run(cc.args(flags.split_whitespace()))?;
                let version = command::read(Command::new(&program).arg("--version"))?;
                Ok((Command::new(program), version))
            }
            "pymodbus" => {
                program = python::environment(self.workspace, name, &[python::PYMODBUS])?;
                let version = "import pymodbus; print(pymodbus.__version__)";
                let version = command::read(Command::new(&program).args(["-c", version]))?;
                let mut server = python::python(&program);
                server.arg(peers.join("pymodbus_server.py"));
                Ok((server, version))
            }
            _ => {
                let version = locked_version(&peers.join("Cargo.lock"), name)?;
                Ok((Command::new(program), version))
            }
        }
    }

    /// Starts a server on a new line, runs these cases against it, and returns the suite's report.
    fn test(
        &self,
        name: &str,
        mut server: Command,
        cases: &[&str],
        traces: Option<&Path>,
    ) -> Result<Value> {
        let start = |mut command: Command| {
            // The suite reports the bad frames that a server logs, so its log is not shown.
            command.stdout(Stdio::piped()).stderr(Stdio::null());
            Group::start(command)
        };
        let mut line = start(Command::new(&self.line))?;
        let [port, other] = [line.line()?, line.line()?];
        server.arg(port);
        let mut running = start(server)?;
        let ready = running.line().with_context(|| name.to_owned())?;
        ensure!(ready == "ready", "{name} does not start: {ready}");
        let json = self.line.with_file_name(format!("{name}.json"));
        let mut suite = Command::new(&self.suite);
        suite.args(["--serial", &other, "--baud", "19200", "--format", "8N2"]);
        let profile = self.workspace.root.join(PROFILE);
        suite.arg("--profile").arg(profile);
        let output = command::output(suite.args(cases).arg("--json").arg(&json))?;
        if let Some(directory) = traces {
            fs::create_dir_all(directory)?;
            fs::write(directory.join(format!("{name}.cases")), &output.stdout)?;
            fs::write(directory.join(format!("{name}.trace")), &output.stderr)?;
        }
        // 0: all cases passed, 1: cases failed.
        if !matches!(output.status.code(), Some(0 | 1)) {
            bail!("{name} cannot be tested: {}", command::complaint(&output));
        }
        if let Some(status) = running.ended()? {
            bail!("{name} has ended during the test ({status})");
        }
        Ok(serde_json::from_str(&fs::read_to_string(&json)?)?)
    }
}

/// Returns the version of a package in a Cargo.lock.
fn locked_version(lock: &Path, name: &str) -> Result<String> {
    let mut packages = locked(lock, "version")?.into_keys();
    let package = packages.find(|(package, _)| package == name);
    let (_, version) = package.with_context(|| format!("{} has no {name}", lock.display()))?;
    Ok(version)
}

/// Returns the row of a server in the table, from the suite's report.
fn row(name: &str, version: &str, report: &Value) -> String {
    let cases = report["cases"].as_array().into_iter().flatten();
    let failed = cases.filter(|case| case["result"] == "failed");
    let groups = failed.filter_map(|case| case["name"].as_str()?.split('/').next());
    // The cases of a group are together.
    let groups: Vec<&str> = groups.collect();
    let groups = groups.chunk_by(|one, next| one == next);
    let groups = groups.map(|same| format!("`{}` {}", same[0], same.len()));
    let groups = groups.collect::<Vec<_>>().join(", ");
    let [passed, failed, skipped] = ["passed", "failed", "skipped"].map(|key| &report[key]);
    format!("| {name} | {version} | {passed} | {failed} | {skipped} | {groups} |\n")
}

fn replaced(document: &str, table: &str) -> Option<String> {
    let (before, rest) = document.split_once(BEGIN)?;
    let (_, after) = rest.split_once(END)?;
    Some(format!("{before}{BEGIN}{table}{END}{after}"))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn failures_are_counted_by_group() {
        let case = |name: &str, result: &str| json!({ "name": name, "result": result });
        let report = json!({ "passed": 1, "failed": 3, "skipped": 1, "cases": [
            case("fc01/data", "passed"),
            case("fc01/length", "failed"),
            case("fc05/value", "failed"),
            case("fc05/address", "failed"),
            case("power/answers", "skipped"),
        ] });
        let row = row("fake", "1.2", &report);
        assert_eq!(row, "| fake | 1.2 | 1 | 3 | 1 | `fc01` 1, `fc05` 2 |\n");
    }

    #[test]
    fn document_has_a_place_for_the_table_and_the_locked_versions() {
        let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
        let document = fs::read_to_string(root.join(DOCUMENT)).unwrap();
        let new = replaced(&document, "a table\n").unwrap();
        assert!(new.contains("-->\na table\n<!--"));
        let lock = root.join("tools/peers/Cargo.lock");
        let python = fs::read_to_string(root.join(python::PYMODBUS)).unwrap();
        let mut python = python
            .lines()
            .filter_map(|line| line.strip_prefix("pymodbus=="));
        for (name, version) in [
            ("modbus-core", locked_version(&lock, "modbus-core").unwrap()),
            ("rmodbus", locked_version(&lock, "rmodbus").unwrap()),
            ("pymodbus", python.next().unwrap().to_owned()),
        ] {
            let row = format!("| {name} | {version} |");
            assert!(document.contains(&row), "{row}: run `cargo xtask peers`");
        }
    }
}
