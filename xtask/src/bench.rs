//! `cargo xtask bench`: what the release image costs, in instructions and bytes, which repeat: every
//! request, the processor under load, flash and RAM by crate; beside it servers on other crates.
//!
//! `tools/bench` measures, this builds what it needs, shows it and holds it against the baseline.

use std::path::{Path, PathBuf};

use register_map::Board;
use serde_json::Value;

use crate::toolchain::{Need, TARGET};
use crate::workspace::Workspace;
use crate::{Failure, Result, build, command, size};

mod baseline;
mod footprint;
mod share;
mod table;

/// The file with the figures of a board's last release.
fn baseline(workspace: &Workspace, board: &Board) -> PathBuf {
    let name = format!("baseline-{board}.json");
    workspace.root().join("tools/bench").join(name)
}

/// The servers on other crates: a workspace of its own.
pub const RIVALS: &str = "tools/bench/rivals/Cargo.toml";
const RIVAL_NAMES: [&str; 2] = ["rmodbus", "modbus-core"];

/// What to measure and how to report it.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    #[command(flatten)]
    build: build::Options,

    /// Print JSON instead of tables
    #[arg(long)]
    json: bool,

    /// Make these figures the baseline
    #[arg(long)]
    bless: bool,
}

/// `cargo xtask bench`.
///
/// # Errors
///
/// When something does not build, the image does not serve a request, or a figure is over its budget, or worse
/// than the baseline by more than its tolerance.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let board = options.build.board;
    let elf = build::image(workspace, board)?.elf;
    let report = measure(workspace, &elf, board)?;
    if options.json {
        say!("{report:#}");
    } else {
        say!("{}", table::of(&report).trim_end());
    }
    let file = baseline(workspace, board);
    if options.bless {
        return baseline::write(&file, &report);
    }
    within_budgets(&report)?;
    baseline::hold(&file, &report)
}

/// Fails when a figure is over its budget, and names all that are.
fn within_budgets(report: &Value) -> Result<()> {
    let over = table::over_budget(report);
    if over.is_empty() {
        return Ok(());
    }
    Err(Failure::new(format!("over budget: {}", over.join("; "))))
}

/// The step of `cargo xtask ci`: the tables, and the baseline held.
///
/// # Errors
///
/// As [`run`].
pub fn check(workspace: &mut Workspace, elf: &Path, board: &Board) -> Result<()> {
    let report = measure(workspace, elf, board)?;
    say!("{}", table::of(&report).trim_end());
    within_budgets(&report)?;
    baseline::hold(&baseline(workspace, board), &report)
}

fn measure(workspace: &mut Workspace, elf: &Path, board: &Board) -> Result<Value> {
    let rivals = rivals(workspace)?;
    let mut cargo = workspace.cargo("run");
    // The simulator's core, crate rigless, declares a newer rustc than it needs.
    cargo.args([
        "--quiet",
        "--ignore-rust-version",
        "--package",
        "bench",
        "--",
    ]);
    cargo.arg(elf).args(["--board", board.name, "--rivals"]);
    cargo.args(rivals);
    let text = command::read(&mut cargo)?;
    let mut report: Value = serde_json::from_str(&text)
        .map_err(|error| Failure::new(format!("the bench's report is broken: {error}")))?;
    share::add(&mut report, elf)?;
    report["image"] = size::report(elf, board)?;
    footprint::add(&mut report, elf)?;
    Ok(report)
}

/// Builds the rivals and tells where they are.
fn rivals(workspace: &mut Workspace) -> Result<Vec<PathBuf>> {
    let target = workspace.target().join("rivals");
    let mut cargo = workspace.target_cargo(Need::Build, "build")?;
    cargo.args([
        "--quiet",
        "--release",
        "--manifest-path",
        RIVALS,
        "--target-dir",
    ]);
    command::run(cargo.arg(&target))?;
    let directory = target.join(TARGET).join("release");
    Ok(RIVAL_NAMES.map(|name| directory.join(name)).to_vec())
}
