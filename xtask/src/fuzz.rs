//! `cargo xtask fuzz`: the targets of `fuzz/` under libFuzzer, with the compiler that is there.
//!
//! cargo-fuzz wants a nightly compiler for the address sanitizer, which code without `unsafe` has no use
//! for; coverage alone any compiler can. libFuzzer's own source comes with the crate libfuzzer-sys and
//! needs a C++ compiler. What is found goes under `target/fuzz`: the committed corpus stays as it is.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use crate::steps::Outcome;
use crate::workspace::Workspace;
use crate::{Failure, Result, command};

mod log;

/// A workspace of its own.
pub const MANIFEST: &str = "fuzz/Cargo.toml";

/// The seeds, a directory for each target.
const SEEDS: &str = "fuzz/corpus";

/// How long each target runs in CI, in seconds.
const SECONDS_IN_CI: u32 = 15;

/// The coverage that libFuzzer wants, as cargo-fuzz asks the compiler for it.
const COVERAGE: &str = "--cfg fuzzing -Cpasses=sancov-module -Ccodegen-units=1 \
    -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares";

/// Longest input, in bytes; longest time for one, in seconds; most memory, in MiB.
const LIMITS: [&str; 3] = ["-max_len=4096", "-timeout=10", "-rss_limit_mb=1024"];

/// What is fuzzed: the binaries of `fuzz/`.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
#[value(rename_all = "snake_case")]
pub enum Target {
    /// Characters, faults and silences through the RTU receiver
    ReceiverRtu,
    /// The same through the ASCII receiver
    ReceiverAscii,
    /// Requests through the server
    Pdu,
    /// Flash pages, saves, starts and power cuts through the configuration store
    Store,
}

impl Target {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::ReceiverRtu,
        Self::ReceiverAscii,
        Self::Pdu,
        Self::Store,
    ];

    const fn name(self) -> &'static str {
        match self {
            Self::ReceiverRtu => "receiver_rtu",
            Self::ReceiverAscii => "receiver_ascii",
            Self::Pdu => "pdu",
            Self::Store => "store",
        }
    }
}

/// What to fuzz.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// Only this target
    #[arg(value_enum)]
    target: Option<Target>,

    /// For how long, each
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(1..))]
    seconds: u32,

    /// Run this input, no other
    #[arg(
        long,
        value_name = "FILE",
        requires = "target",
        conflicts_with = "seconds"
    )]
    input: Option<PathBuf>,
}

/// `cargo xtask fuzz`.
///
/// # Errors
///
/// When there is no C++ compiler, something does not build, or an input was found that should not be:
/// where it is and how to run it again. Every target has been run then.
pub fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    compiler()?;
    let targets = options.target.map_or(Target::ALL.to_vec(), |one| vec![one]);
    if let (Some(input), [target]) = (&options.input, targets.as_slice()) {
        return again(workspace, *target, input);
    }
    session(workspace, &targets, options.seconds)
}

/// The step of `cargo xtask ci`: every target for a short time. Skipped without a C++ compiler, but
/// failed when `strict`.
pub fn step(workspace: &Workspace, strict: bool) -> Outcome {
    match compiler() {
        Ok(()) => session(workspace, &Target::ALL, SECONDS_IN_CI).into(),
        Err(missing) if strict => Outcome::Failed(missing.to_string()),
        Err(missing) => Outcome::Skipped(missing.to_string()),
    }
}

/// Whether libFuzzer can be compiled: looked for where crate cc looks.
fn compiler() -> Result<()> {
    let name = std::env::var_os("CXX").unwrap_or_else(|| "c++".into());
    let version = command::read(Command::new(name).arg("--version"));
    version.map(|_| ()).map_err(|why| {
        let what = "libFuzzer needs a C++ compiler (on Debian: g++)";
        Failure::new(format!("{what}: {why}"))
    })
}

fn session(workspace: &Workspace, targets: &[Target], seconds: u32) -> Result<()> {
    let programs = build(workspace, targets)?;
    let mut found = Vec::new();
    for (target, program) in targets.iter().zip(programs) {
        if let Err(failure) = fuzz(workspace, *target, &program, seconds) {
            eprintln!("{failure}");
            found.push(target.name());
        }
    }
    if found.is_empty() {
        Ok(())
    } else {
        let what = format!("found something in {}: above", found.join(", "));
        Err(Failure::new(what))
    }
}

/// Where everything is that fuzzing makes.
fn directory(workspace: &Workspace) -> PathBuf {
    workspace.target().join("fuzz")
}

fn build(workspace: &Workspace, targets: &[Target]) -> Result<Vec<PathBuf>> {
    let directory = directory(workspace);
    let host = host(workspace)?;
    let mut cargo = workspace.cargo("build");
    cargo.args(["--release", "--locked", "--manifest-path", MANIFEST]);
    // Named, so that build scripts and macros are compiled without coverage.
    cargo.args(["--target", &host]);
    for target in targets {
        cargo.args(["--bin", target.name()]);
    }
    if directory.join(&host).exists() {
        cargo.arg("--quiet");
    }
    cargo.arg("--target-dir").arg(&directory);
    cargo.env_remove("CARGO_ENCODED_RUSTFLAGS");
    command::run(cargo.env("RUSTFLAGS", COVERAGE))?;
    let built = directory.join(host).join("release");
    let program = |target: &Target| built.join(target.name());
    Ok(targets.iter().map(program).collect())
}

/// The triple of this machine.
fn host(workspace: &Workspace) -> Result<String> {
    let text = command::read(workspace.cargo("version").arg("--verbose"))?;
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned)
        .ok_or_else(|| Failure::new("`cargo version` names no host"))
}

/// Runs a target for a time, and tells in a line what came of it.
fn fuzz(workspace: &Workspace, target: Target, program: &Path, seconds: u32) -> Result<()> {
    let name = target.name();
    let directory = directory(workspace);
    let made = |path: PathBuf| match fs::create_dir_all(&path) {
        Ok(()) => Ok(path),
        Err(error) => {
            let what = format!("cannot make {}: {error}", path.display());
            Err(Failure::new(what))
        }
    };
    // libFuzzer adds to the first directory alone.
    let corpus = made(directory.join("corpus").join(name))?;
    let mut prefix = made(directory.join("found"))?.join(name).into_os_string();
    prefix.push("-");
    let log = directory.join(format!("{name}.log"));
    let output = File::create(&log)
        .map_err(|error| Failure::new(format!("cannot write {}: {error}", log.display())))?;
    eprintln!("{name}: {seconds} s, log in {}", log.display());

    let mut fuzzer = Command::new(program);
    fuzzer
        .current_dir(workspace.root())
        .arg(&corpus)
        .arg(workspace.root().join(SEEDS).join(name))
        .args(LIMITS)
        .arg(format!("-max_total_time={seconds}"))
        .arg(option("-artifact_prefix=", &prefix))
        .stderr(output);
    let begin = Instant::now();
    let ended = command::run(&mut fuzzer);
    let text = fs::read(&log).unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    match ended {
        Ok(()) => {
            say!("{name}: {}", log::summary(&text, begin.elapsed()));
            Ok(())
        }
        Err(failure) => Err(log::finding(&text).map_or(failure, |finding| {
            let file = finding.file;
            let again = format!("cargo xtask fuzz {name} --input {file}");
            Failure::new(format!("{name}: {}\nagain: {again}", finding.what))
        })),
    }
}

fn option(name: &str, value: &std::ffi::OsStr) -> std::ffi::OsString {
    let mut option = std::ffi::OsString::from(name);
    option.push(value);
    option
}

/// Runs one input, with a backtrace when it fails.
fn again(workspace: &Workspace, target: Target, input: &Path) -> Result<()> {
    if !input.is_file() {
        let what = format!("there is no input {}", input.display());
        return Err(Failure::asked(what));
    }
    let programs = build(workspace, &[target])?;
    let mut fuzzer = Command::new(&programs[0]);
    fuzzer.arg(input).args(LIMITS).env("RUST_BACKTRACE", "1");
    command::run(&mut fuzzer)
}

#[cfg(test)]
mod tests;
