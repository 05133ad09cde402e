//! `cargo xtask sim`: builds the images and the simulator, then replaces this process with the simulator.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Error, Result};
use register_map::Board;
use sim_options::Options;

use crate::error::usage;
use crate::workspace::Workspace;
use crate::{build, command};

/// `cargo xtask sim`. The `arguments` have already been parsed into `options`, so that a wrong one is refused before
/// the build.
pub fn run(
    workspace: &mut Workspace,
    options: &Options,
    arguments: impl IntoIterator<Item = OsString>,
) -> Result<()> {
    options.check_line().map_err(usage)?;
    if let Some((_, elf)) = options.elf.iter().find(|(_, elf)| !elf.is_file()) {
        return Err(no_image(elf));
    }
    let fittings = options.fittings().map_err(usage)?;
    let mut built = Vec::new();
    for board in Board::ALL {
        let wanted = fittings.iter().any(|fitting| fitting.board == board);
        if wanted && options.elf_of(board).is_none() {
            let elf = build::image(workspace, board)?.elf;
            built.push(command::joined(&format!("--elf={}=", board.name), elf));
        }
    }
    let mut simulator = Command::new(simulator(workspace)?);
    command::exec(simulator.args(arguments).args(built))
}

/// Runs a board in the simulator, with this image or one that is built.
pub fn run_image(workspace: &mut Workspace, board: &Board, elf: Option<&Path>) -> Result<()> {
    let elf = match elf {
        Some(elf) if !elf.is_file() => return Err(no_image(elf)),
        Some(elf) => elf.to_owned(),
        None => build::image(workspace, board)?.elf,
    };
    let mut simulator = Command::new(simulator(workspace)?);
    simulator
        .args(["--board", board.name])
        .arg("--elf")
        .arg(elf);
    command::exec(&mut simulator)
}

/// Builds the simulator and returns its path.
pub fn simulator(workspace: &Workspace) -> Result<PathBuf> {
    workspace.program("modio-sim")
}

fn no_image(elf: &Path) -> Error {
    usage(format!("there is no image {}", elf.display()))
}
