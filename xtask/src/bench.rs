//! `cargo xtask bench`: the costs of the release image in instructions and bytes, which are the same in every run:
//! every request, the processor's load, flash and RAM by crate, and servers on other crates for comparison.
//!
//! `tools/bench` measures. This command builds the programs for it, shows the figures and compares them with the
//! baseline.

use std::process::Command;

use anyhow::{Context as _, Result, ensure};
use fs_err as fs;
use register_map::layout::HEADER;
use register_map::{Row, update::Slot};
use serde_json::{Value, json};

use crate::workspace::{self, Workspace};
use crate::{build, command, image, peers, signed, size};

mod figures;
#[cfg(test)]
mod pages;
mod server;
mod table;

/// The servers on other crates.
const RIVALS: [&str; 2] = ["rmodbus", "modbus-core"];

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
    let report = measure(workspace, board)?;
    if options.json {
        say!("{report:#}");
    } else {
        say!("{}", table::of(&report));
    }
    let baseline = format!("tools/bench/baseline-{board}.json");
    let baseline = workspace.root.join(baseline);
    if options.bless {
        return figures::write(&baseline, &report);
    }
    let over = figures::over_budget(&report);
    ensure!(over.is_empty(), "over budget: {}", over.join("; "));
    figures::compare(&baseline, &report)
}

/// The step of `cargo xtask ci`.
pub fn check(workspace: &mut Workspace, board: &'static Row) -> Result<()> {
    let build = build::Options { board };
    let (json, bless) = (false, false);
    run(workspace, &Options { build, json, bless })
}

fn measure(workspace: &mut Workspace, board: &'static Row) -> Result<Value> {
    let loader = build::loader(workspace, board)?;
    let image = signed::image(workspace, board)?;
    let elf = build::image(workspace, board)?;
    let mut build = rivals(workspace, "build")?;
    let rivals = workspace::artifacts(build.arg("--quiet"))?;
    let mut program = Command::new(workspace.program("modio-bench")?);
    program.arg(&elf).args(["--board", board.name, "--loader"]);
    program.arg(&loader).arg("--signed").arg(&image);
    program.arg("--rivals");
    for name in RIVALS {
        program.arg(workspace::executable(&rivals, name)?);
    }
    let report = serde_json::from_str(&command::read(&mut program)?);
    let mut report: Value = report.context("the report of tools/bench is broken")?;
    report["image"] = size::report(&elf)?;
    report["loader"] = size::report(&loader)?;
    let application = fs::metadata(&image)?.len() - u64::from(HEADER);
    let [slot, _] = size::limit(board, Some(Slot::A));
    report["slot"] = json!({ "flash": application, "budget": slot });
    server::add(&mut report, &image::parse(&image::read(&elf)?)?)?;
    Ok(report)
}

/// Returns cargo for the rivals.
pub fn rivals(workspace: &mut Workspace, subcommand: &str) -> Result<Command> {
    let target = workspace.target.join("rivals");
    let mut cargo = workspace.target_cargo(subcommand)?;
    cargo.args([
        "--release",
        "--manifest-path",
        peers::MANIFEST,
        "--package",
        "rivals",
    ]);
    cargo.arg("--target-dir").arg(target);
    Ok(cargo)
}
