//! `cargo xtask fuzz`: the targets of `fuzz/` with libFuzzer, compiled by the installed compiler.
//!
//! cargo-fuzz needs a nightly compiler for the address sanitizer, which finds nothing in code without `unsafe`.
//! Coverage works with any compiler. The source of libFuzzer is in the crate libfuzzer-sys and needs a C++ compiler.
//! New inputs are written to `target/fuzz`, and the committed corpus does not change.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Result, bail, ensure};
use fs_err as fs;

use crate::error::{missing, usage};
use crate::workspace::{self, MESSAGES, Workspace};
use crate::{command, dist};

/// The manifest of the fuzz targets, a separate workspace.
pub const MANIFEST: &str = "fuzz/Cargo.toml";

/// The binaries of `fuzz/`: receivers of characters, faults and silences in both modes; requests through the server;
/// pages, saves, starts and power cuts through the configuration store.
const TARGETS: [&str; 4] = ["receiver_rtu", "receiver_ascii", "pdu", "store"];

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
const OPTIONS: &str =
    "-max_len=4096 -timeout=10 -rss_limit_mb=1024 -verbosity=0 -print_final_stats=1";

/// What to fuzz.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// Only this target
    #[arg(value_parser = TARGETS)]
    target: Option<String>,

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

/// `cargo xtask fuzz`.
pub fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    let Some(target) = options.target.as_deref() else {
        return session(workspace, &TARGETS, options.seconds);
    };
    let Some(input) = &options.input else {
        return session(workspace, &[target], options.seconds);
    };
    if !input.is_file() {
        return Err(usage(format!("there is no input {}", input.display())));
    }
    let mut fuzzer = Command::new(&build(workspace, &[target])?[0]);
    fuzzer.arg(input).args(OPTIONS.split(' '));
    command::run(fuzzer.env("RUST_BACKTRACE", "1"))
}

/// Runs every target for a short time.
pub fn check(workspace: &mut Workspace) -> Result<()> {
    session(workspace, &TARGETS, SECONDS_IN_CI)
}

/// Runs every target, even when another one has found a failure.
fn session(workspace: &Workspace, targets: &[&str], seconds: u32) -> Result<()> {
    let mut failed = Vec::new();
    for (target, program) in targets.iter().zip(build(workspace, targets)?) {
        if let Err(error) = fuzz(workspace, target, &program, seconds) {
            eprintln!("{error:#}\nrun that input again: cargo xtask fuzz {target} --input FILE");
            failed.push(*target);
        }
    }
    if !failed.is_empty() {
        bail!("an input of {} fails, see above", failed.join(", "));
    }
    Ok(())
}

fn build(workspace: &Workspace, targets: &[&str]) -> Result<Vec<PathBuf>> {
    // The compiler that crate cc uses.
    let compiler = std::env::var_os("CXX").unwrap_or_else(|| "c++".into());
    ensure!(
        which::which(compiler).is_ok(),
        missing("libFuzzer needs a C++ compiler (on Debian: g++)")
    );
    let mut cargo = workspace.other("build", MANIFEST, "fuzz");
    // With --target, build scripts and macros are compiled without coverage.
    cargo.args(["--release", MESSAGES, "--target", &dist::host()?]);
    for target in targets {
        cargo.args(["--bin", target]);
    }
    cargo.env_remove("CARGO_ENCODED_RUSTFLAGS");
    let artifacts = workspace::artifacts(cargo.env("RUSTFLAGS", COVERAGE))?;
    let program = |target: &&str| workspace::executable(&artifacts, target);
    targets.iter().map(program).collect()
}

fn fuzz(workspace: &Workspace, name: &str, program: &Path, seconds: u32) -> Result<()> {
    eprintln!("{name}: {seconds} s");
    let directory = workspace.target().join("fuzz");
    let (corpus, found) = (directory.join("corpus").join(name), directory.join("found"));
    fs::create_dir_all(&corpus)?;
    fs::create_dir_all(&found)?;
    let mut fuzzer = Command::new(program);
    // libFuzzer writes new inputs to the first directory only. The second one has the seeds.
    fuzzer.arg(&corpus).arg(Path::new("fuzz/corpus").join(name));
    let most = format!("-max_total_time={seconds}");
    let prefix = format!("-artifact_prefix={}/{name}-", found.display());
    fuzzer.args(OPTIONS.split(' ')).args([most, prefix]);
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
        let fuzz = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../fuzz"));
        let manifest = fs::read_to_string(fuzz.join("Cargo.toml")).unwrap();
        assert_eq!(manifest.matches("[[bin]]").count(), TARGETS.len());
        for name in TARGETS {
            assert!(manifest.contains(&format!("name = \"{name}\"")), "{name}");
            let seeds = fuzz.join("corpus").join(name);
            assert!(fs::read_dir(seeds).unwrap().count() > 10, "{name}");
        }
    }
}
