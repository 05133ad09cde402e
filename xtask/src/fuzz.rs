//! `cargo xtask fuzz`: the targets of `fuzz/` with libFuzzer, compiled by the installed compiler.
//!
//! cargo-fuzz needs a nightly compiler for the address sanitizer, which finds nothing in code without `unsafe`.
//! Coverage works with any compiler. The source of libFuzzer is in the crate libfuzzer-sys and needs a C++ compiler.
//! New inputs are written to `target/fuzz`, and the committed corpus does not change.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Result, bail, ensure};
use clap::ValueEnum;
use fs_err as fs;

use crate::error::{Missing, usage};
use crate::workspace::{self, MESSAGES, Workspace};
use crate::{command, dist};

/// The manifest of the fuzz targets, a separate workspace.
pub const MANIFEST: &str = "fuzz/Cargo.toml";

/// The seeds, a directory for each target.
const SEEDS: &str = "fuzz/corpus";

/// Time for each target in CI, in seconds.
const SECONDS_IN_CI: u32 = 15;

/// The coverage that libFuzzer needs, with the options that cargo-fuzz passes to the compiler.
const COVERAGE: &str = "--cfg fuzzing -Cpasses=sancov-module -Ccodegen-units=1 \
    -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares";

/// Longest input, in bytes; longest time for one input, in seconds; most memory, in MiB. No line for each new input,
/// but the counts at the end.
const OPTIONS: [&str; 5] = [
    "-max_len=4096",
    "-timeout=10",
    "-rss_limit_mb=1024",
    "-verbosity=0",
    "-print_final_stats=1",
];

/// The binaries of `fuzz/`.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
#[value(rename_all = "snake_case")]
enum Target {
    /// Characters, faults and silences through the RTU receiver
    ReceiverRtu,
    /// Characters, faults and silences through the ASCII receiver
    ReceiverAscii,
    /// Requests through the server
    Pdu,
    /// Flash pages, saves, starts and power cuts through the configuration store
    Store,
}

impl Target {
    fn name(self) -> String {
        let value = self.to_possible_value();
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    }
}

/// What to fuzz.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// Only this target
    #[arg(value_enum)]
    target: Option<Target>,

    /// Time for each target, in seconds
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..))]
    seconds: u32,

    /// Run this input and no other, with a backtrace when it fails
    #[arg(
        long,
        value_name = "FILE",
        requires = "target",
        conflicts_with = "seconds"
    )]
    input: Option<PathBuf>,
}

/// `cargo xtask fuzz`. Every target runs, even when another one has found a failure.
pub fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    let targets = options
        .target
        .map_or(Target::value_variants().to_vec(), |one| vec![one]);
    if let (Some(input), [target]) = (&options.input, targets.as_slice()) {
        if !input.is_file() {
            return Err(usage(format!("there is no input {}", input.display())));
        }
        let mut fuzzer = Command::new(&build(workspace, &[*target])?[0]);
        return command::run(fuzzer.arg(input).args(OPTIONS).env("RUST_BACKTRACE", "1"));
    }
    session(workspace, &targets, options.seconds)
}

/// Runs every target for a short time.
pub fn check(workspace: &Workspace) -> Result<()> {
    session(workspace, Target::value_variants(), SECONDS_IN_CI)
}

fn session(workspace: &Workspace, targets: &[Target], seconds: u32) -> Result<()> {
    let mut failed = Vec::new();
    for (target, program) in targets.iter().zip(build(workspace, targets)?) {
        if let Err(error) = fuzz(workspace, &target.name(), &program, seconds) {
            let name = target.name();
            eprintln!("{error:#}\nrun that input again: cargo xtask fuzz {name} --input FILE");
            failed.push(name);
        }
    }
    if !failed.is_empty() {
        bail!("an input of {} fails, see above", failed.join(", "));
    }
    Ok(())
}

/// Returns the directory of all files that fuzzing writes.
fn directory(workspace: &Workspace) -> PathBuf {
    workspace.target().join("fuzz")
}

fn build(workspace: &Workspace, targets: &[Target]) -> Result<Vec<PathBuf>> {
    // The compiler that crate cc uses.
    let compiler = std::env::var_os("CXX").unwrap_or_else(|| "c++".into());
    which::which(compiler)
        .map_err(|_| Missing("libFuzzer needs a C++ compiler (on Debian: g++)".to_owned()))?;
    let mut cargo = workspace.cargo("build");
    cargo.args([
        "--release",
        "--locked",
        "--manifest-path",
        MANIFEST,
        MESSAGES,
    ]);
    // With --target, build scripts and macros are compiled without coverage.
    cargo.args(["--target", &dist::host()?]);
    for target in targets {
        cargo.args(["--bin", &target.name()]);
    }
    cargo.arg("--target-dir").arg(directory(workspace));
    cargo.env_remove("CARGO_ENCODED_RUSTFLAGS");
    let artifacts = workspace::artifacts(cargo.env("RUSTFLAGS", COVERAGE))?;
    let program = |target: &Target| workspace::executable(&artifacts, &target.name());
    targets.iter().map(program).collect()
}

fn fuzz(workspace: &Workspace, name: &str, program: &Path, seconds: u32) -> Result<()> {
    eprintln!("{name}: {seconds} s");
    let [corpus, found] = ["corpus", "found"].map(|part| directory(workspace).join(part));
    let corpus = corpus.join(name);
    fs::create_dir_all(&corpus)?;
    fs::create_dir_all(&found)?;
    let mut fuzzer = Command::new(program);
    // libFuzzer writes new inputs to the first directory only.
    fuzzer
        .arg(&corpus)
        .arg(workspace.root().join(SEEDS).join(name));
    fuzzer.args(OPTIONS);
    fuzzer.arg(format!("-max_total_time={seconds}"));
    fuzzer.arg(command::joined(
        "-artifact_prefix=",
        found.join(format!("{name}-")),
    ));
    let output = command::output(fuzzer.current_dir(workspace.root()))?;
    let text = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "{text}\n{name}: {}", output.status);
    // Leave out the dictionary that libFuzzer recommends after every run.
    for line in text.lines().filter(|line| line.starts_with("stat::")) {
        say!("{line}");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_target_is_a_binary_with_seeds() {
        let workspace = Workspace::open().unwrap();
        let manifest = fs::read_to_string(workspace.root().join(MANIFEST)).unwrap();
        assert_eq!(
            manifest.matches("[[bin]]").count(),
            Target::value_variants().len()
        );
        for target in Target::value_variants() {
            let name = target.name();
            assert!(manifest.contains(&format!("name = \"{name}\"")), "{name}");
            let seeds = workspace.root().join(SEEDS).join(&name);
            assert!(fs::read_dir(seeds).unwrap().count() > 10, "{name}");
        }
    }
}
