//! `cargo xtask sim`: builds the images and the simulator, then replaces this process with the simulator.

use std::ffi::OsString;
use std::process::Command;

use anyhow::Result;
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
        return Err(usage(format!("there is no image {}", elf.display())));
    }
    let fittings = options.fittings().map_err(usage)?;
    let mut built = Vec::new();
    for board in Board::ALL {
        let wanted = fittings.iter().any(|fitting| fitting.board == board);
        if wanted && options.elf_of(board).is_none() {
            let elf = build::image(workspace, board)?;
            built.push(format!("--elf={}={}", board.name, elf.display()));
        }
    }
    let mut simulator = Command::new(workspace.simulator()?);
    command::exec(simulator.args(arguments).args(built))
}
