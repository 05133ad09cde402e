//! `cargo xtask sim`: builds the simulator and the loader and images that it needs, then replaces this process with the
//! simulator.

use std::ffi::OsString;
use std::process::Command;

use anyhow::Result;
use register_map::Row;

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
    for (kind, board) in lines.lines().filter_map(missing_file) {
        let file = match kind {
            "loader" => build::loader(workspace, board)?,
            "image" => signed::image(workspace, board)?,
            _ => build::image(workspace, board)?,
        };
        simulator.arg(format!("--{kind}={board}={}", file.display()));
    }
    command::exec(&mut simulator)
}

/// Returns kind and board of a file that a line of the simulator names, or `None`: it may print its help instead.
fn missing_file(line: &str) -> Option<(&str, &'static Row)> {
    let (kind, board) = line.split_once(' ')?;
    Some((kind, board.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use register_map::board::MODIO_08;

    use super::*;

    #[test]
    fn help_and_version_name_no_missing_file() {
        assert_eq!(missing_file("loader modio-08"), Some(("loader", &MODIO_08)));
        for line in [
            "modio-sim 0.3.0-dev",
            "Usage: modio-sim [OPTIONS]",
            "",
            "Options:",
        ] {
            assert_eq!(missing_file(line), None, "{line}");
        }
    }
}
