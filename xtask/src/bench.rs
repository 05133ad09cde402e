//! `cargo xtask bench`: the costs of the release image in instructions and bytes, which are the same in every run:
//! every request, the processor's load, flash and RAM by crate, and servers on other crates for comparison.
//!
//! `tools/bench` measures. This command builds the programs for it, shows the figures and compares them with the
//! baseline.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, ensure};
use register_map::Board;
use serde_json::{Value, json};

use crate::steps::Bench;
use crate::workspace::{self, MESSAGES, Workspace};
use crate::{build, command, image, size};

mod baseline;
mod server;
mod table;

/// The servers on other crates, a separate workspace.
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

/// `cargo xtask bench`. A figure over its budget or worse than the baseline is an error.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let board = options.build.board;
    let elf = build::image(workspace, board)?.elf;
    let report = measure(workspace, &elf, board)?;
    if options.json {
        say!("{report:#}");
    } else {
        say!("{}", table::of(&report));
    }
    if options.bless {
        return baseline::write(&file(workspace, board), &report);
    }
    within_limits(workspace, board, &report)
}

/// The step of `cargo xtask ci`.
pub fn check(bench: &mut Bench, board: &'static Board) -> Result<()> {
    let elf = bench.image(board)?;
    let report = measure(bench.workspace, &elf, board)?;
    say!("{}", table::of(&report));
    within_limits(bench.workspace, board, &report)
}

/// Returns the file with the baseline of a board.
fn file(workspace: &Workspace, board: &Board) -> PathBuf {
    let name = format!("baseline-{board}.json");
    workspace.root().join("tools/bench").join(name)
}

fn within_limits(workspace: &Workspace, board: &Board, report: &Value) -> Result<()> {
    let over = table::over_budget(report);
    ensure!(over.is_empty(), "over budget: {}", over.join("; "));
    baseline::compare_with(&file(workspace, board), report)
}

fn measure(workspace: &mut Workspace, elf: &Path, board: &Board) -> Result<Value> {
    let rivals = rivals(workspace)?;
    let mut program = Command::new(workspace.program("modio-bench")?);
    program.arg(elf).args(["--board", board.name, "--rivals"]);
    let text = command::read(program.args(rivals))?;
    let mut report: Value =
        serde_json::from_str(&text).context("the report of tools/bench is broken")?;
    let bytes = image::read(elf)?;
    let parsed = image::parse(&bytes)?;
    server::add_instructions(&mut report, &parsed)?;
    report["image"] = size::report(elf, board)?;
    let structures = size::structures(&parsed, server::CRATE)?;
    report["server"] = json!({
        "flash": server::flash(&report["image"])?,
        "ram": server::ram(&structures)?,
    });
    Ok(report)
}

/// Builds the rivals and returns where they are.
fn rivals(workspace: &mut Workspace) -> Result<Vec<PathBuf>> {
    let target = workspace.target().join("rivals");
    let mut cargo = workspace.target_cargo("build")?;
    cargo.args(["--quiet", "--release", "--manifest-path", RIVALS, MESSAGES]);
    let artifacts = workspace::artifacts(cargo.arg("--target-dir").arg(&target))?;
    let programs = RIVAL_NAMES
        .iter()
        .map(|name| workspace::executable(&artifacts, name));
    programs.collect()
}
