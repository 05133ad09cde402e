//! `cargo xtask fuzz`: the targets of `fuzz/` with cargo-fuzz.
//!
//! Of cargo-fuzz only the address sanitizer needs a nightly compiler, and it finds nothing in code without `unsafe`.
//! New inputs are written to `target/fuzz`, and the committed corpus does not change.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Result, ensure};
use fs_err as fs;
use rayon::prelude::*;

use crate::error::{missing, usage};
use crate::workspace::Workspace;
use crate::{command, group};

/// The manifest of the fuzz targets, a separate workspace.
pub const MANIFEST: &str = "fuzz/Cargo.toml";

const SECONDS_IN_CI: u32 = 10;

/// Longest input, in bytes; longest time for one input, in seconds; most memory, in MiB. No line for each new input,
/// but the counts at the end.
const OPTIONS: &str =
    "-max_len=4096 -timeout=10 -rss_limit_mb=1024 -verbosity=0 -print_final_stats=1";

/// What to fuzz.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// Only this target: receiver_rtu, receiver_ascii, pdu, fast, store, update or description
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
    let mut targets = targets(workspace)?;
    if let Some(target) = &options.target {
        if !targets.contains(target) {
            let targets = targets.join(", ");
            return Err(usage(format!("no target {target:?}; use one of {targets}")));
        }
        targets = vec![target.clone()];
    }
    let Some(input) = &options.input else {
        return session(workspace, &targets, options.seconds);
    };
    if !input.is_file() {
        return Err(usage(format!("there is no input {}", input.display())));
    }
    let input = std::path::absolute(input)?;
    command::run(&mut fuzz(workspace, &targets[0], &[input], "-runs=1"))
}

/// Runs every target for a short time.
pub fn check(workspace: &mut Workspace) -> Result<()> {
    session(workspace, &targets(workspace)?, SECONDS_IN_CI)
}

fn targets(workspace: &Workspace) -> Result<Vec<String>> {
    let Ok(names) = command::read(workspace.cargo("fuzz").arg("list")) else {
        let advice = "cargo-fuzz is not installed: cargo install --locked cargo-fuzz";
        return Err(missing(advice));
    };
    Ok(names.lines().map(str::to_owned).collect())
}

/// Runs every target, even when another one has found a failure: one on each core, and shows the output of each at its end.
fn session(workspace: &Workspace, targets: &[String], seconds: u32) -> Result<()> {
    let limit = format!("-max_total_time={seconds}");
    command::run(&mut cargo_fuzz(workspace, "build"))?;
    let run = |target: &String| -> Result<bool> {
        group::not_interrupted()?;
        let new = workspace.target.join("fuzz/corpus").join(target);
        fs::create_dir_all(&new)?;
        // libFuzzer writes new inputs to the first directory only. The second one has the seeds.
        let corpus = [new, Path::new("fuzz/corpus").join(target)];
        let done = command::output(&mut fuzz(workspace, target, &corpus, &limit))?;
        let text = [done.stdout, done.stderr].concat();
        eprintln!("{target}:\n{}", String::from_utf8_lossy(&text));
        Ok(done.status.success())
    };
    let passed: Vec<bool> = targets.par_iter().map(run).collect::<Result<_>>()?;
    let failed = targets.iter().zip(passed).filter(|(_, passed)| !passed);
    let failed: Vec<_> = failed.map(|(target, _)| target.as_str()).collect();
    let names = failed.join(", ");
    ensure!(failed.is_empty(), "failed, see above: {names}");
    Ok(())
}

fn cargo_fuzz(workspace: &Workspace, subcommand: &str) -> Command {
    let mut cargo = workspace.cargo("fuzz");
    cargo.args([subcommand, "--sanitizer", "none", "--target-dir"]);
    cargo.arg(workspace.target.join("fuzz"));
    cargo
}

/// Returns a run of a target with these inputs.
fn fuzz(workspace: &Workspace, target: &str, inputs: &[PathBuf], limit: &str) -> Command {
    let mut cargo = cargo_fuzz(workspace, "run");
    cargo.arg(target).args(inputs);
    cargo.args(["--", limit]).args(OPTIONS.split(' '));
    cargo.env("RUST_BACKTRACE", "1");
    cargo
}
