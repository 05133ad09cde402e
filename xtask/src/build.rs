//! `cargo xtask build`: the release image, as an ELF file for a debugger or the simulator and as a .bin for a
//! programmer. For tests also the loader, and the applications for the slots behind it.

use std::path::{Path, PathBuf};

use anyhow::Result;
use cargo_metadata::PackageId;
use fs_err as fs;
use register_map::Board;
use register_map::board::MODIO_02;
use register_map::update::Slot;

use crate::error::usage;
use crate::image;
use crate::toolchain::TARGET;
use crate::workspace::{self, Workspace};

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

/// The board, and an image for it.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Given {
    #[command(flatten)]
    options: Options,

    /// Use this image instead of building one
    #[arg(long, value_name = "FILE")]
    elf: Option<PathBuf>,
}

impl Given {
    pub fn board(&self) -> &'static Board {
        self.options.board
    }

    /// Returns the ELF file of the image, which is built unless the option names one. A file without an image is a
    /// usage error.
    pub fn elf(&self, workspace: &mut Workspace) -> Result<PathBuf> {
        let Some(elf) = &self.elf else {
            return image(workspace, self.board());
        };
        let flat = image::read(elf).and_then(|bytes| image::flat(&bytes, u32::MAX));
        flat.map_err(|why| usage(format!("{}: {why:#}", elf.display())))?;
        Ok(std::path::absolute(elf)?)
    }
}

/// `cargo xtask build`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    let elf = image(workspace, options.board)?;
    say!("{}\n{}", elf.display(), elf.with_extension("bin").display());
    Ok(())
}

/// Builds every program of a board: the loader, the application for both slots, and the image that runs alone.
pub fn all(workspace: &mut Workspace, board: &Board) -> Result<()> {
    loader(workspace, board)?;
    for slot in Slot::ALL {
        self::slot(workspace, board, slot)?;
    }
    image(workspace, board).map(drop)
}

/// Builds the image, and returns its ELF file, with symbols and debug information.
pub fn image(workspace: &mut Workspace, board: &Board) -> Result<PathBuf> {
    Ok(linked(workspace, board, None)?.0)
}

/// Builds the loader, and returns its ELF file.
pub fn loader(workspace: &mut Workspace, board: &Board) -> Result<PathBuf> {
    Ok(program(workspace, board, ["loader", "loader", board.name], None)?.0)
}

/// Builds the application for a slot behind the loader, and returns its ELF file.
pub fn slot(workspace: &mut Workspace, board: &Board, slot: Slot) -> Result<PathBuf> {
    let letter = match slot {
        Slot::A => "a",
        Slot::B => "b",
    };
    let features = format!("{board},slot-{letter}");
    let (elf, _) = program(workspace, board, ["firmware", "modio", &features], None)?;
    // Leave no image for a slot under the name of the image that runs alone.
    let kept = elf.with_file_name(format!("modio-{letter}"));
    fs::rename(&elf, &kept)?;
    fs::rename(elf.with_extension("bin"), kept.with_extension("bin"))?;
    Ok(kept)
}

/// Builds the image that runs without a loader, and writes the linker's map to a file. Returns the ELF file, and the
/// packages that were compiled for the target.
pub fn linked(
    workspace: &mut Workspace,
    board: &Board,
    map: Option<&Path>,
) -> Result<(PathBuf, Vec<PackageId>)> {
    program(workspace, board, ["firmware", "modio", board.name], map)
}

/// Builds a program for a board: its package, its name, and the features. Checks that it cannot panic and that its code
/// in RAM needs no flash. Writes the flash from 0x0800_0000 on to a .bin.
fn program(
    workspace: &mut Workspace,
    board: &Board,
    [package, name, features]: [&str; 3],
    map: Option<&Path>,
) -> Result<(PathBuf, Vec<PackageId>)> {
    let target = target(&workspace.target, board);
    let mut cargo = workspace.target_cargo("build")?;
    cargo.args(["--profile", PROFILE, "--package", package]);
    cargo.args(["--bin", name, "--features", features]);
    cargo.arg("--target-dir").arg(&target);
    // The variable that firmware/build.rs reads.
    cargo.envs(map.map(|map| ("MODIO_MAP", map)));
    let artifacts = workspace::artifacts(&mut cargo)?;
    let elf = workspace::executable(&artifacts, name)?;
    let bytes = image::read(&elf)?;
    let flash = image::flat(&bytes, board.memory().part.flash)?;
    image::check(&bytes)?;
    fs::write(elf.with_extension("bin"), flash)?;
    let packages = workspace::packages(&artifacts, &target.join(TARGET));
    Ok((elf, packages))
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
