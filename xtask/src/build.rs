//! `cargo xtask build`: the release image, as an ELF file for a debugger or the simulator and as a .bin for a
//! programmer.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use cargo_metadata::PackageId;
use fs_err as fs;
use register_map::Board;
use register_map::board::MODIO_02;

use crate::board::Hardware;
use crate::toolchain::TARGET;
use crate::workspace::{self, MESSAGES, Workspace};
use crate::{command, image};

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

fn linked(workspace: &mut Workspace, board: &Board, map: Option<&Path>) -> Result<Image> {
    let target = target(workspace.target(), board);
    // Only `cargo rustc` has options for the linker with which dependencies are not compiled again.
    let subcommand = if map.is_some() { "rustc" } else { "build" };
    let mut cargo = workspace.target_cargo(subcommand)?;
    cargo.args(["--profile", PROFILE, "--package", "firmware"]);
    cargo.args(["--bin", "modio", "--features", board.name, MESSAGES]);
    cargo.arg("--target-dir").arg(&target);
    if let Some(map) = map {
        cargo.arg("--");
        cargo.arg(command::joined("-Clink-arg=-Map=", map));
    }
    let artifacts = workspace::artifacts(&mut cargo)?;
    let for_target = target.join(TARGET);
    let compiled = artifacts.iter().filter(|artifact| {
        let mut files = artifact.filenames.iter();
        files.any(|file| file.as_std_path().starts_with(&for_target))
    });
    let elf = workspace::executable(&artifacts, "modio")?;
    let bin = elf.with_extension("bin");
    let bytes = image::read(&elf)?;
    let flash = image::flat(&bytes, Hardware::of(board).part.flash)?;
    check(&bytes)?;
    fs::write(&bin, flash)?;
    Ok(Image {
        packages: compiled.map(|built| built.package_id.clone()).collect(),
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

/// Refuses an image that can panic, or whose code in RAM calls functions in flash.
fn check(image: &[u8]) -> Result<()> {
    let panics = image::panics(image)?;
    if !panics.is_empty() {
        let lines = panics
            .iter()
            .map(|(panic, callers)| match callers.as_slice() {
                [] => format!("\n  {panic}, which nothing calls directly"),
                callers => format!("\n  {panic}, called by {}", callers.join(", ")),
            });
        let lines: String = lines.collect();
        bail!("the image can panic, which a release image must not; remove the calls to{lines}");
    }
    let called = image::calls_from_ram(image)?;
    if !called.is_empty() {
        bail!(
            "code in RAM calls functions in flash, which cannot run during a save; add them to .ram_code in \
             firmware/memory/sections.x\n  {}",
            called.join("\n  ")
        );
    }
    Ok(())
}
