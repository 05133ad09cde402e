//! `cargo xtask build`: the release image, as an ELF file for a debugger or the simulator and as a .bin for a
//! programmer.

use std::path::{Path, PathBuf};

use anyhow::Result;
use cargo_metadata::PackageId;
use fs_err as fs;
use register_map::Board;
use register_map::board::MODIO_02;

use crate::board::Hardware;
use crate::error::usage;
use crate::image;
use crate::toolchain::TARGET;
use crate::workspace::{self, MESSAGES, Workspace};

/// The profile of the root Cargo.toml that the image is built with.
pub const PROFILE: &str = "firmware";

/// What to build.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// The board: modio-02 or modio-08
    #[arg(long, value_name = "NAME", default_value_t = &MODIO_02)]
    pub board: &'static Board,
}

/// A built image.
#[derive(Clone, Debug)]
pub struct Image {
    /// With symbols and debug information.
    pub elf: PathBuf,
    /// The flash from 0x0800_0000 on.
    pub bin: PathBuf,
    /// The packages that were compiled for the target.
    pub packages: Vec<PackageId>,
}

/// `cargo xtask build`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let image = image(workspace, options.board)?;
    say!("{}\n{}", image.elf.display(), image.bin.display());
    Ok(())
}

/// Builds the image, and checks that it cannot panic and that its code in RAM needs no flash.
pub fn image(workspace: &mut Workspace, board: &Board) -> Result<Image> {
    linked(workspace, board, None)
}

/// Builds the image, and writes the linker's map to a file.
pub fn image_with_map(workspace: &mut Workspace, board: &Board, map: &Path) -> Result<Image> {
    linked(workspace, board, Some(map))
}

/// Returns the image that an option names, or builds it. An image that does not fit the board is a usage error.
pub fn given(workspace: &mut Workspace, board: &Board, elf: Option<&Path>) -> Result<PathBuf> {
    let Some(elf) = elf else {
        return Ok(image(workspace, board)?.elf);
    };
    let flat = image::read(elf).and_then(|bytes| image::flat(&bytes, u32::MAX));
    flat.map_err(|why| usage(format!("{}: {why:#}", elf.display())))?;
    Ok(std::path::absolute(elf)?)
}

fn linked(workspace: &mut Workspace, board: &Board, map: Option<&Path>) -> Result<Image> {
    let target = target(workspace.target(), board);
    let mut cargo = workspace.target_cargo("build")?;
    cargo.args(["--profile", PROFILE, "--package", "firmware"]);
    cargo.args(["--bin", "modio", "--features", board.name, MESSAGES]);
    cargo.arg("--target-dir").arg(&target);
    if let Some(map) = map {
        // The variable that firmware/build.rs reads.
        cargo.env("MODIO_MAP", map);
    }
    let artifacts = workspace::artifacts(&mut cargo)?;
    let elf = workspace::executable(&artifacts, "modio")?;
    let bin = elf.with_extension("bin");
    let bytes = image::read(&elf)?;
    let flash = image::flat(&bytes, Hardware::of(board).part.flash)?;
    image::check(&bytes)?;
    fs::write(&bin, flash)?;
    Ok(Image {
        packages: workspace::packages(&artifacts, &target.join(TARGET)),
        elf,
        bin,
    })
}

/// Returns the target directory of a board. The images have the same name, so each board has a separate directory:
/// building for one board neither replaces the image of the other nor compiles it again.
pub fn target(directory: &Path, board: &Board) -> PathBuf {
    if *board == MODIO_02 {
        directory.to_owned()
    } else {
        directory.join(board.name)
    }
}
