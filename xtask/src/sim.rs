//! `cargo xtask sim`: builds the images and the simulator, then becomes the simulator.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::Command;

use register_map::Board;
use sim_options::Options;

use crate::workspace::Workspace;
use crate::{Failure, Result, build, command};

/// `cargo xtask sim`; `arguments` are the options as they were given, already parsed once into
/// `options` so that a wrong one is refused before anything is built.
///
/// # Errors
///
/// When an image or the simulator cannot be built or started.
pub fn run(
    workspace: &mut Workspace,
    options: &Options,
    arguments: impl IntoIterator<Item = OsString>,
) -> Result<()> {
    options.check_line().map_err(Failure::asked)?;
    let named = options.elf.iter().map(|(_, elf)| elf);
    if let Some(elf) = named.into_iter().find(|elf| !elf.is_file()) {
        return Err(Failure::asked(format!(
            "there is no image {}",
            elf.display()
        )));
    }
    let fittings = options.fittings().map_err(Failure::asked)?;
    let mut built: Vec<OsString> = Vec::new();
    for board in Board::ALL {
        let wanted = fittings.iter().any(|fitting| fitting.board == board);
        if wanted && options.elf_of(board).is_none() {
            let elf = build::image(workspace, board)?.elf;
            let mut argument = OsString::from(format!("--elf={}=", board.name));
            argument.push(elf);
            built.push(argument);
        }
    }
    let mut simulator = Command::new(simulator(workspace)?);
    simulator.args(arguments).args(built);
    become_simulator(&mut simulator)
}

/// Builds the simulator and tells where it is.
///
/// # Errors
///
/// When it does not build.
pub fn simulator(workspace: &Workspace) -> Result<PathBuf> {
    let name = format!("modio-sim{}", std::env::consts::EXE_SUFFIX);
    let program = workspace.target().join("debug").join(name);
    let mut cargo = workspace.cargo("build");
    // Its core, crate rigless, declares a newer rustc than it needs.
    cargo.args([
        "--ignore-rust-version",
        "--package",
        "sim",
        "--bin",
        "modio-sim",
    ]);
    if program.exists() {
        cargo.arg("--quiet");
    } else {
        eprintln!("building the simulator, which takes minutes the first time");
    }
    command::run(&mut cargo)?;
    Ok(program)
}

#[cfg(unix)]
use command::exec as become_simulator;

/// Without exec: runs the simulator and ends as it does.
#[cfg(not(unix))]
fn become_simulator(simulator: &mut Command) -> Result<()> {
    command::run(simulator)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_that_is_not_there_is_refused_before_the_simulator_is_built() {
        use clap::Parser;
        #[derive(Parser)]
        struct Cli {
            #[command(flatten)]
            options: Options,
        }
        let options = Cli::parse_from(["sim", "--elf", "/nowhere/modio"]).options;
        let mut workspace = Workspace::open().unwrap();
        let failure = run(&mut workspace, &options, []).unwrap_err();
        assert_eq!(failure.to_string(), "there is no image /nowhere/modio");
        assert_eq!(failure.code, 2);
    }
}
