//! `cargo xtask ci`: formatting, lints and documentation with every warning an error, for the host and for the
//! microcontroller, then the steps of `cargo xtask test`, and those that take longer.

use std::process::Command;

use anyhow::Result;
use register_map::Board;

use crate::steps::{Bench, In, Step, short};
use crate::test::{self, Chosen};
use crate::workspace::Workspace;
use crate::{bench, build, command, fuzz, peers, renode};

/// The packages of the image.
const TARGET_PACKAGES: [&str; 5] = [
    "firmware",
    "board-support",
    "modio-drivers",
    "modbus-server",
    "register-map",
];

/// The workspaces of this project.
const WORKSPACES: [&str; 4] = ["Cargo.toml", fuzz::MANIFEST, bench::RIVALS, peers::MANIFEST];

/// The options of `cargo xtask ci`.
#[derive(clap::Args, Debug)]
pub struct Options {
    #[command(flatten)]
    steps: Chosen,
}

/// `cargo xtask ci`. A step whose tool is missing fails.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    options.steps.run(workspace, In::Ci)
}

/// Returns all steps, in the order in which they run.
pub fn steps() -> Vec<Step> {
    let step = |name: &str, what: &str, run: fn(&mut Bench) -> Result<()>| {
        Step::new(In::Ci, name, what, run)
    };
    let for_board = |name: &str, what: &str, run: fn(&mut Bench, &'static Board) -> Result<()>| {
        Board::ALL.map(|board| {
            let name = format!("{name}-{}", short(board));
            Step::new(In::Ci, name, format!("{what}, {board}"), move |bench| {
                run(bench, board)
            })
        })
    };
    let mut all = vec![step("fmt", "formatting", formatting)];
    all.push(step("lint-host", "lints, host", |bench| {
        let mut cargo = bench.workspace.cargo("clippy");
        cargo.args(["--workspace", "--all-targets", "--ignore-rust-version"]);
        deny_warnings(cargo)
    }));
    all.extend(for_board("lint", "lints, target", |bench, board| {
        let mut cargo = bench.workspace.target_cargo("clippy")?;
        for_target(&mut cargo, board);
        for package in TARGET_PACKAGES {
            cargo.args(["--package", package]);
        }
        deny_warnings(cargo)
    }));
    all.extend([
        step("lint-fuzz", "lints, fuzz targets", |bench| {
            lint_other(bench.workspace, fuzz::MANIFEST, "fuzz")
        }),
        step("lint-rivals", "lints, rivals of the bench", |bench| {
            let rivals = bench.workspace.target().join("rivals");
            let mut cargo = bench.workspace.target_cargo("clippy")?;
            cargo.args(["--release", "--manifest-path", bench::RIVALS]);
            cargo.arg("--target-dir").arg(rivals);
            deny_warnings(cargo)
        }),
        step("lint-peers", "lints, peers", |bench| {
            lint_other(bench.workspace, peers::MANIFEST, "peers")
        }),
        step("doc-host", "documentation, host", |bench| {
            let mut cargo = bench.workspace.cargo("doc");
            cargo.args(["--workspace", "--ignore-rust-version"]);
            // Most of board-support exists for the target only.
            cargo.args(["--exclude", "board-support"]);
            documentation(cargo)
        }),
    ]);
    all.extend(for_board("doc", "documentation, target", |bench, board| {
        let mut cargo = bench.workspace.target_cargo("doc")?;
        for_target(&mut cargo, board);
        cargo.args(["--package", "board-support", "--package", "firmware"]);
        documentation(cargo)
    }));
    all.extend(test::steps());
    all.extend(test::corners());
    all.extend(for_board("bench", "instructions and bytes", bench::check));
    all.extend(for_board(
        "suites",
        "Renode's suites in simulation",
        |bench, board| {
            let elf = bench.image(board)?;
            renode::checks::on_simulator(bench.workspace, board, &elf)
        },
    ));
    all.extend([
        step("peers", "servers of cargo xtask peers, briefly", |bench| {
            peers::check(bench.workspace)
        }),
        step("fuzz", "fuzz targets, briefly", |bench| {
            fuzz::check(bench.workspace)
        }),
    ]);
    all
}

fn formatting(bench: &mut Bench) -> Result<()> {
    // Check all workspaces, even when one fails.
    let checked = WORKSPACES.map(|manifest| {
        let mut cargo = bench.workspace.cargo("fmt");
        command::run(cargo.args(["--all", "--check", "--manifest-path", manifest]))
    });
    checked.into_iter().collect()
}

/// Adds the options that compile code for a board.
fn for_target(cargo: &mut Command, board: &Board) {
    cargo.args(["--profile", build::PROFILE]);
    cargo.args(["--features", &format!("firmware/{board}")]);
}

/// Lints a separate workspace, whose build products are in a separate directory.
fn lint_other(workspace: &Workspace, manifest: &str, directory: &str) -> Result<()> {
    let mut cargo = workspace.cargo("clippy");
    cargo.args(["--locked", "--manifest-path", manifest]);
    cargo
        .arg("--target-dir")
        .arg(workspace.target().join(directory));
    deny_warnings(cargo)
}

fn deny_warnings(mut cargo: Command) -> Result<()> {
    command::run(cargo.args(["--", "-Dwarnings"]))
}

fn documentation(mut cargo: Command) -> Result<()> {
    cargo.args(["--no-deps", "--document-private-items"]);
    // Private items are documented too, so links to them are valid.
    let flags = "-Dwarnings -Arustdoc::private-intra-doc-links";
    command::run(cargo.env("RUSTDOCFLAGS", flags))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn names_of_steps_are_unique() {
        let names: Vec<String> = steps().into_iter().map(|step| step.name).collect();
        assert_eq!(names.len(), names.iter().collect::<BTreeSet<_>>().len());
    }
    #[test]
    fn workflow_runs_every_step() {
        let workflow = include_str!("../../.github/workflows/ci.yml");
        let words: BTreeSet<&str> = workflow.split_whitespace().collect();
        for step in steps() {
            let name = step.name.as_str();
            assert!(words.contains(name), "{name} is in no job of ci.yml");
        }
    }
}
