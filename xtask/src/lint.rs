//! The first steps of `cargo xtask ci`: formatting, lints and documentation, with every warning an error.

use std::process::Command;

use anyhow::Result;
use register_map::Row;
use register_map::board::{FX3U_24, MODIO_02};

use crate::workspace::{ALL, SUITE, Workspace};
use crate::{bench, build, command, fuzz, peers};

/// The parts of the boards, each with the board for which its programs are checked. The two differ in what
/// their rows say of switch, second line, events and slots. What only a board has are its pins, which are compiled for every board.
pub const PARTS: [(&str, &Row); 2] = [("small", &MODIO_02), ("large", &FX3U_24)];

/// The programs for the microcontroller, each with its packages. They need different features of board-support.
const PROGRAMS: [(&str, &str); 2] = [
    (
        "firmware",
        "firmware board-support boot-state modio-drivers ports modbus-server register-map",
    ),
    (
        "loader",
        "loader board-support boot-state ports register-map",
    ),
];

const WORKSPACES: [&str; 3] = ["Cargo.toml", fuzz::MANIFEST, peers::MANIFEST];

pub fn formatting(workspace: &mut Workspace) -> Result<()> {
    // Check all workspaces, even when one fails.
    let checked = WORKSPACES.map(|manifest| {
        let mut cargo = workspace.cargo("fmt");
        command::run(cargo.args(["--all", "--check", "--manifest-path", manifest]))
    });
    checked.into_iter().collect()
}

fn deny_warnings(mut cargo: Command) -> Result<()> {
    command::run(cargo.args(["--", "-Dwarnings"]))
}

pub fn host(workspace: &mut Workspace) -> Result<()> {
    let mut cargo = workspace.cargo("clippy");
    // With the code of the suite that is in the simulator only.
    cargo.args(ALL).args(["--all-targets", "--features", SUITE]);
    deny_warnings(cargo)
}

/// Returns cargo with the options that compile a program for a board.
fn for_target(
    workspace: &mut Workspace,
    subcommand: &str,
    program: &str,
    board: &Row,
) -> Result<Command> {
    let mut cargo = workspace.target_cargo(subcommand)?;
    cargo.args(["--profile", build::PROFILE]);
    let features = format!("{program}/board,board-support/{board}");
    cargo.args(["--features", &features]);
    Ok(cargo)
}

pub fn target(workspace: &mut Workspace, board: &'static Row) -> Result<()> {
    for (program, packages) in PROGRAMS {
        let mut cargo = for_target(workspace, "clippy", program, board)?;
        for package in packages.split(' ') {
            cargo.args(["--package", package]);
        }
        deny_warnings(cargo)?;
    }
    Ok(())
}

pub fn fuzz_targets(workspace: &mut Workspace) -> Result<()> {
    deny_warnings(workspace.other("clippy", fuzz::MANIFEST, "fuzz"))
}

pub fn peers(workspace: &mut Workspace) -> Result<()> {
    deny_warnings(workspace.other("clippy", peers::MANIFEST, "peers"))?;
    deny_warnings(bench::rivals(workspace, "clippy")?)
}

fn documentation(mut cargo: Command) -> Result<()> {
    cargo.args(["--no-deps", "--document-private-items"]);
    // Private items are documented too, so links to them are valid.
    let flags = "-Dwarnings -Arustdoc::private-intra-doc-links";
    command::run(cargo.env("RUSTDOCFLAGS", flags))
}

pub fn doc_host(workspace: &mut Workspace) -> Result<()> {
    let mut cargo = workspace.cargo("doc");
    // Most of board-support exists for the target only.
    cargo.args(ALL).args(["--exclude", "board-support"]);
    documentation(cargo)
}

pub fn doc_target(workspace: &mut Workspace, board: &'static Row) -> Result<()> {
    for (program, _) in PROGRAMS {
        let mut cargo = for_target(workspace, "doc", program, board)?;
        cargo.args(["--package", "board-support", "--package", program]);
        documentation(cargo)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_is_checked_and_with_slots_and_without() {
        let checked = |is: &dyn Fn(&Row) -> bool| PARTS.iter().any(|(_, board)| is(board));
        for board in Row::ALL {
            let part = board.memory.part;
            assert!(checked(&|of| of.memory.part.flash == part.flash), "{board}");
            let has_slots = board.fixed.is_empty();
            assert!(checked(&|of| of.fixed.is_empty() == has_slots), "{board}");
        }
    }
}
