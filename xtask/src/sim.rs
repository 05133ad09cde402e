//! `cargo xtask sim`: builds the simulator and the loader and images that it needs, then replaces this process with the
//! simulator.

use std::ffi::OsString;
use std::process::Command;

use anyhow::Result;
use register_map::{Board, update::Slot};

use crate::workspace::Workspace;
use crate::{build, command, signed};

/// `cargo xtask sim`. The simulator alone knows its options. It names the files that are missing; with a wrong option it
/// names none, and reports the error when it is started.
pub fn run(workspace: &mut Workspace, arguments: &[OsString]) -> Result<()> {
    let program = workspace.simulator()?;
    let mut simulator = Command::new(&program);
    simulator.args(arguments);
    let asked = command::output(Command::new(program).args(arguments).arg("--missing-files"))?;
    let lines = String::from_utf8_lossy(&asked.stdout);
    for (kind, board) in lines.lines().filter_map(|line| line.split_once(' ')) {
        let board: &'static Board = board.parse()?;
        let file = match kind {
            "loader" => build::loader(workspace, board)?,
            "image" => signed::image(workspace, &signed::Options::of(board), Slot::A)?,
            _ => build::image(workspace, board)?,
        };
        simulator.arg(format!("--{kind}={board}={}", file.display()));
    }
    command::exec(&mut simulator)
}
