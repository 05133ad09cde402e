//! `cargo xtask build`: the release image, as an ELF file for a debugger or the simulator and as a
//! .bin for a programmer.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use crate::toolchain::{Need, TARGET};
use crate::workspace::Workspace;
use crate::{Failure, Result, command, image};

/// The profile of the root Cargo.toml that the image is built with.
pub const PROFILE: &str = "firmware";

/// A board the firmware runs on.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Board {
    /// The modio-02 carrier, or a Blue Pill with an RS-485 transceiver.
    #[value(name = "modio-02")]
    Modio02,
}

/// What to build.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// The board to build for
    #[arg(long, value_enum, default_value_t = Board::Modio02)]
    pub board: Board,
}

impl Options {
    /// The image as released: for the modio-02.
    #[must_use]
    pub const fn release() -> Self {
        Self {
            board: Board::Modio02,
        }
    }
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
    let image = image(workspace, options)?;
    say!("{}", image.elf.display());
    say!("{}", image.bin.display());
    Ok(())
}

/// Builds the image.
///
/// # Errors
///
/// When there is no toolchain for the target, the image does not build, it could panic, or its code in RAM needs flash.
pub fn image(workspace: &mut Workspace, options: &Options) -> Result<Image> {
    linked(workspace, options, None)
}

/// The same, with the linker's map in a file.
///
/// # Errors
///
/// As [`image()`].
pub fn image_with_map(workspace: &mut Workspace, options: &Options, map: &Path) -> Result<Image> {
    linked(workspace, options, Some(map))
}

fn linked(workspace: &mut Workspace, options: &Options, map: Option<&Path>) -> Result<Image> {
    let Board::Modio02 = options.board;
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
    cargo.args(["--features", "board"]);
    if let Some(map) = map {
        cargo.arg("--").arg(map_argument(map));
    }
    command::run(&mut cargo)?;

    let elf = workspace.target().join(TARGET).join(PROFILE).join("modio");
    let bin = elf.with_extension("bin");
    let bytes = image::read(&elf)?;
    check_panics(&bytes)?;
    check_ram_code(&bytes)?;
    let bytes = image::flat(&bytes).map_err(Failure::new)?;
    fs::write(&bin, bytes)
        .map_err(|error| Failure::new(format!("cannot write {}: {error}", bin.display())))?;
    Ok(Image { elf, bin })
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
         firmware/memory.x\n  {}",
        called.join("\n  ")
    )))
}

/// Refuses an image into which something is linked that panics.
fn check_panics(image: &[u8]) -> Result<()> {
    let panics = image::panics::linked(image).map_err(Failure::new)?;
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
