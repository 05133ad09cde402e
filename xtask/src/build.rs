//! Builds the programs of a board: the loader, the application for a slot behind it, and the application that runs without
//! a loader. Each is an ELF file for a debugger or the simulator, and a .bin for a programmer.

use std::path::{Path, PathBuf};

use anyhow::Result;
use cargo_metadata::PackageId;
use fs_err as fs;
use register_map::Row;
use register_map::board::MODIO_02;
use register_map::update::Slot;

use crate::error::usage;
use crate::toolchain::TARGET;
use crate::workspace::{self, Workspace};
use crate::{image, keys};

/// The profile of the root Cargo.toml that the image is built with.
pub const PROFILE: &str = "firmware";

/// What to build.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// The board
    #[arg(help = format!("The board: {}", Row::ALL.map(|board| board.name).join(", ")))]
    #[arg(long, value_name = "NAME", default_value_t = &MODIO_02)]
    pub board: &'static Row,
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
    /// Returns whether the option names an image.
    pub fn is_given(&self) -> bool {
        self.elf.is_some()
    }

    pub fn board(&self) -> &'static Row {
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

/// A program of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Program {
    /// The loader.
    Loader,
    /// The application, linked for a slot behind the loader.
    Slot(Slot),
    /// The application, linked to run without a loader.
    Alone,
}

/// A program that was built.
pub struct Built {
    /// Its ELF file, with symbols and debug information. A .bin with the flash from 0x0800_0000 on is beside it.
    pub elf: PathBuf,
    /// The packages that were compiled for the target.
    pub packages: Vec<PackageId>,
}

/// Builds the image that runs without a loader, and returns its ELF file.
pub fn image(workspace: &mut Workspace, board: &Row) -> Result<PathBuf> {
    Ok(program(workspace, board, Program::Alone, None)?.elf)
}

/// Builds the loader, and returns its ELF file.
pub fn loader(workspace: &mut Workspace, board: &Row) -> Result<PathBuf> {
    // A build script could only panic.
    keys::Pair::of(workspace)?;
    Ok(program(workspace, board, Program::Loader, None)?.elf)
}

/// Builds a program for a board, and writes the linker's map to a file. Checks that it cannot panic and that its code in
/// RAM needs no flash. Writes the flash from 0x0800_0000 on to a .bin.
pub fn program(
    workspace: &mut Workspace,
    board: &Row,
    program: Program,
    map: Option<&Path>,
) -> Result<Built> {
    let (package, name, slot) = match program {
        Program::Loader => ("loader", "loader", None),
        Program::Slot(Slot::A) => ("firmware", "modio", Some("a")),
        Program::Slot(Slot::B) => ("firmware", "modio", Some("b")),
        Program::Alone => ("firmware", "modio", None),
    };
    let target = target(&workspace.target, board);
    let mut cargo = workspace.target_cargo("build")?;
    cargo.args(["--profile", PROFILE, "--package", package]);
    cargo.args(["--bin", name]);
    cargo.args(["--features", &format!("board,board-support/{board}")]);
    if let Some(letter) = slot {
        cargo.args(["--features", &format!("slot-{letter}")]);
    }
    cargo.arg("--target-dir").arg(&target);
    // The boards share what is compiled for all of them.
    cargo.env("CARGO_BUILD_BUILD_DIR", &workspace.target);
    // The variables that firmware/build.rs and loader/build.rs read.
    cargo.envs(map.map(|map| ("MODIO_MAP", map)));
    cargo.envs(workspace.keys.as_ref().map(|keys| ("MODIO_KEYS", keys)));
    // Cargo gives every application the same name. Only the image that runs alone keeps it.
    let alone = target.join(TARGET).join(PROFILE).join("modio");
    let aside = alone.with_file_name("modio-aside");
    if slot.is_some() && alone.exists() {
        fs::rename(&alone, &aside)?;
    }
    let artifacts = workspace::artifacts(&mut cargo)?;
    let mut elf = workspace::executable(&artifacts, name)?;
    if let Some(letter) = slot {
        elf.set_file_name(format!("modio-{letter}"));
        fs::rename(&alone, &elf)?;
        if aside.exists() {
            fs::rename(&aside, &alone)?;
        }
    }
    let bytes = image::read(&elf)?;
    let flash = image::flat(&bytes, board.memory.part.flash)?;
    image::check(&bytes)?;
    fs::write(elf.with_extension("bin"), flash)?;
    // Programs are in the first one, libraries in the second one.
    let compiled = [&target, &workspace.target].map(|directory| directory.join(TARGET));
    let packages = workspace::packages(&artifacts, &compiled);
    Ok(Built { elf, packages })
}

/// Parses the letter of a slot.
pub fn slot(letter: &str) -> Result<Slot, String> {
    match letter {
        "a" | "A" => Ok(Slot::A),
        "b" | "B" => Ok(Slot::B),
        _ => Err("a slot is a or b".to_owned()),
    }
}

/// Returns the target directory of a board. The images have the same name, so each board has a separate directory:
/// building for one board does not replace the image of the other.
pub fn target(directory: &Path, board: &Row) -> PathBuf {
    if *board == MODIO_02 {
        directory.to_owned()
    } else {
        directory.join(board.name)
    }
}
