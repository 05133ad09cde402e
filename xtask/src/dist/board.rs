//! The files of a board in a release.

use std::path::Path;

use anyhow::{Context as _, Result};
use fs_err as fs;
use object::{Object as _, ObjectSection as _};
use register_map::part::FLASH_BASE;
use register_map::{Row, update::Slot};

use super::notices::Notices;
use super::paths::Paths;
use super::{Signer, sbom, sha256, signing};
use crate::build::{self, Program};
use crate::image::{self, Elf};
use crate::sources::Sources;
use crate::toolchain::TARGET;
use crate::workspace::Workspace;
use crate::{flash, hex, signed};

/// The files of a board.
pub struct Files<'a> {
    pub workspace: &'a mut Workspace,
    pub sources: &'a Sources,
    pub board: &'static Row,
    pub out: &'a Path,
    pub paths: &'a Paths,
    pub notices: &'a mut Notices,
}

impl Files<'_> {
    /// Makes the files: the image that runs alone, the loader, the application for both slots, and what is signed. Without
    /// a signer those are the images and the bytes to be signed.
    pub fn make(&mut self, signer: &Signer<'_>) -> Result<()> {
        let board = self.board;
        let (alone, entry) = self.program(Program::Alone, board.name)?;
        self.write(
            &format!("{board}.hex"),
            hex::file(&[(FLASH_BASE, alone.clone())], entry)?,
        )?;
        self.write(&format!("{board}.bin"), alone)?;
        self.program(Program::Loader, &format!("{board}-loader"))?;
        let mut images = Vec::new();
        for (slot, name) in Slot::ALL.into_iter().zip(slots(board)) {
            self.program(Program::Slot(slot), &name)?;
            let elf = fs::read(self.out.join(format!("{name}.elf")))?;
            let mut image = signed::unsigned(board, slot, &elf, self.sources)?;
            match signer {
                Signer::Nobody => {
                    self.write(&format!("{name}.tbs"), signed::signed_part(&image))?;
                    self.write(&format!("{name}.image"), &image)?;
                }
                Signer::Key(key) => signed::sign(&mut image, key),
                Signer::Signed(directory, pair) => {
                    let file = directory.join(format!("{board}.modio"));
                    let images = signed::images(&fs::read(&file)?);
                    let signed = images.and_then(|images| {
                        let of_release = &images[slot as usize];
                        signing::check(of_release, board, slot, self.sources)?;
                        let signature = signed::signature(of_release);
                        signed::put_signature(&mut image, signature, pair.keys()).map(drop)
                    });
                    signed.with_context(|| file.display().to_string())?;
                }
            }
            images.push(image);
        }
        match (signer, <[Vec<u8>; 2]>::try_from(images)) {
            (Signer::Key(_) | Signer::Signed(..), Ok(images)) => finish(board, self.out, &images),
            _ => Ok(()),
        }
    }

    /// Builds a program, and writes its ELF file, its bill of materials and for the application its map. Returns its
    /// flash, and its start address.
    fn program(&mut self, program: Program, name: &str) -> Result<(Vec<u8>, u32)> {
        let (package, map) = match program {
            Program::Loader => ("loader", None),
            Program::Slot(_) | Program::Alone => {
                let map = self.workspace.target.join(format!("{name}.map"));
                ("firmware", Some(map))
            }
        };
        let built = build::program(self.workspace, self.board, program, map.as_deref())?;
        let elf = fs::read(&built.elf)?;
        let flash = fs::read(built.elf.with_extension("bin"))?;
        let parsed = image::parse(&elf)?;
        let entry = parsed.entry() as u32;
        let bill = sbom::Subject {
            name,
            kind: "firmware",
            package,
            target: TARGET,
            features: format!("{package}/{}", self.board),
            compiled: &built.packages,
            compiler: &compiler(&parsed)?,
            sha256: sha256(&flash),
        };
        let bill = bill.bill(self.workspace, self.notices)?;
        self.write(&format!("{name}.cdx.json"), bill)?;
        if let Some(map) = map {
            let map = self.paths.replaced(&fs::read_to_string(map)?);
            self.write(&format!("{name}.map"), map)?;
        }
        self.write(&format!("{name}.elf"), elf)?;
        Ok((flash, entry))
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) -> Result<()> {
        Ok(fs::write(self.out.join(name), content)?)
    }
}

/// Returns the names of the images of a board, for slot A and for slot B.
pub fn slots(board: &Row) -> [String; 2] {
    ["a", "b"].map(|letter| format!("{board}-{letter}"))
}

/// Writes the file of an update with these signed images, and loader and slot A for a programmer. The loader is in the
/// directory.
pub fn finish(board: &Row, out: &Path, images: &[Vec<u8>; 2]) -> Result<()> {
    let elf = fs::read(out.join(format!("{board}-loader.elf")))?;
    let loader = image::flat(&elf, board.memory.part.flash)?;
    let entry = image::parse(&elf)?.entry() as u32;
    let [a, _] = images;
    let complete = flash::loaded(board, Slot::A, loader, a.clone());
    let complete = hex::file(&complete, entry)?;
    fs::write(out.join(format!("{board}-complete.hex")), complete)?;
    Ok(fs::write(
        out.join(format!("{board}.modio")),
        signed::file(images),
    )?)
}

/// Returns the version of the rustc that has compiled an image, from a comment in the image.
fn compiler(elf: &Elf<'_>) -> Result<String> {
    let comment = elf.section_by_name(".comment");
    let comment = comment.and_then(|section| section.data().ok());
    let comment = String::from_utf8_lossy(comment.unwrap_or_default());
    let mut texts = comment.split('\0');
    let version = texts.find_map(|text| text.strip_prefix("rustc version "));
    let version = version.context("the image has no comment with its compiler")?;
    Ok(version.to_owned())
}
