//! `cargo xtask sim`: builds the simulator and the images that it needs, then replaces this process with the simulator.

use std::ffi::OsString;
use std::process::Command;

use anyhow::Result;
use register_map::Board;

use crate::workspace::Workspace;
use crate::{build, command};

/// `cargo xtask sim`. The simulator alone knows its options. It names the boards whose image is missing; with a wrong
/// option it names none, and reports the error when it is started.
pub fn run(workspace: &mut Workspace, arguments: &[OsString]) -> Result<()> {
    let program = workspace.simulator()?;
    let mut simulator = Command::new(&program);
    simulator.args(arguments);
    let asked = command::output(
        Command::new(program)
            .args(arguments)
            .arg("--missing-images"),
    )?;
    let lines = String::from_utf8_lossy(&asked.stdout);
    for board in lines.lines().filter_map(|name| name.parse().ok()) {
        let board: &Board = board;
        let elf = build::image(workspace, board)?;
        simulator.arg(format!("--elf={board}={}", elf.display()));
    }
    command::exec(&mut simulator)
}
