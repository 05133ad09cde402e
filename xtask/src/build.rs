//! `cargo xtask build`: the release image, as an ELF file for a debugger or the simulator and as a
//! .bin for a programmer.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use register_map::Board;
use register_map::board::MODIO_02;

use crate::board::Hardware;
use crate::toolchain::{Need, TARGET};
use crate::workspace::Workspace;
use crate::{Failure, Result, command, image};

/// The profile of the root Cargo.toml that the image is built with.
pub const PROFILE: &str = "firmware";

/// What to build.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// The board to build for: modio-02 or modio-08
    #[arg(long, value_name = "NAME", default_value_t = &MODIO_02)]
    pub board: &'static Board,
}

/// A built image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// With symbols and debug information.
    pub elf: PathBuf,
    /// The flash from 0x0800_0000 on.
    pub bin: PathBuf,
}

/// `cargo xtask build`: builds and prints where the files are.
///
/// # Errors
///
/// When there is no toolchain for the target, or the image does not build.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let image = image(workspace, options.board)?;
    say!("{}", image.elf.display());
    say!("{}", image.bin.display());
    Ok(())
}

/// Builds the image.
///
/// # Errors
///
/// When there is no toolchain for the target, the image does not build, it could panic, or its code in RAM needs flash.
pub fn image(workspace: &mut Workspace, board: &Board) -> Result<Image> {
    linked(workspace, board, None)
}

/// The same, with the linker's map in a file.
///
/// # Errors
///
/// As [`image()`].
pub fn image_with_map(workspace: &mut Workspace, board: &Board, map: &Path) -> Result<Image> {
    linked(workspace, board, Some(map))
}

fn linked(workspace: &mut Workspace, board: &Board, map: Option<&Path>) -> Result<Image> {
    let target = target(workspace.target(), board);
    // Only `cargo rustc` has options for the linker that the packages below are not built anew for.
    let subcommand = if map.is_some() { "rustc" } else { "build" };
    let mut cargo = workspace.target_cargo(Need::Build, subcommand)?;
    cargo.args([
        "--profile",
        PROFILE,
        "--package",
        "firmware",
        "--bin",
        "modio",
    ]);
    cargo.args(["--features", board.name, "--target-dir"]);
    cargo.arg(&target);
    if let Some(map) = map {
        cargo.arg("--").arg(map_argument(map));
    }
    command::run(&mut cargo)?;

    let elf = target.join(TARGET).join(PROFILE).join("modio");
    let bin = elf.with_extension("bin");
    let bytes = image::read(&elf)?;
    let flash = image::flat(&bytes, Hardware::of(board).part.flash).map_err(Failure::new)?;
    check_panics(&bytes, &flash)?;
    check_ram_code(&bytes)?;
    fs::write(&bin, flash)
        .map_err(|error| Failure::new(format!("cannot write {}: {error}", bin.display())))?;
    Ok(Image { elf, bin })
}

/// The target directory of a board. The image of every board has the same name, so that each has a directory of its
/// own: a build for the one board neither replaces the image of the other nor compiles anything of it anew.
pub(crate) fn target(directory: &Path, board: &Board) -> PathBuf {
    if *board == MODIO_02 {
        directory.to_owned()
    } else {
        directory.join(board.name)
    }
}

fn map_argument(map: &Path) -> OsString {
    let mut argument = OsString::from("-Clink-arg=-Map=");
    argument.push(map);
    argument
}

/// Refuses an image whose code in RAM calls something in flash.
fn check_ram_code(image: &[u8]) -> Result<()> {
    let called = image::ram_code::calls_into_flash(image).map_err(Failure::new)?;
    if called.is_empty() {
        return Ok(());
    }
    Err(Failure::new(format!(
        "code in RAM calls functions in flash, which cannot run during a save: add them to .ram_code in \
         firmware/memory/sections.x\n  {}",
        called.join("\n  ")
    )))
}

/// Refuses an image into which something is linked that panics.
fn check_panics(image: &[u8], flash: &[u8]) -> Result<()> {
    let panics = image::panics::linked(image, flash).map_err(Failure::new)?;
    if panics.is_empty() {
        return Ok(());
    }
    let mut text = "the image can panic, which a release image must not".to_owned();
    for panic in panics {
        let callers = match panic.callers.as_slice() {
            [] => "nothing directly".to_owned(),
            callers => callers.join(", "),
        };
        text.push_str(&format!("\n  {}, called by {callers}", panic.name));
    }
    Err(Failure::new(text))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_board_has_a_target_directory_of_its_own_and_the_modio_02_the_workspaces() {
        let directory = Path::new("/x/target");
        assert_eq!(target(directory, &MODIO_02), directory);
        let all = Board::ALL.map(|board| target(directory, board));
        assert!(all.iter().all(|path| path.starts_with(directory)));
        assert_eq!(BTreeSet::from(all).len(), Board::ALL.len());
    }
}
