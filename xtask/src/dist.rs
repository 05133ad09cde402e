//! `cargo xtask dist`: all files of a release in one directory. docs/releasing.md lists them.
//!
//! On Linux the same commit and the same rustc give the same bytes in any directory and at any time: see [`paths`].

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result};
use ed25519_dalek::{SigningKey, VerifyingKey};
use fs_err as fs;
use object::{Object as _, ObjectSection as _};
use register_map::part::FLASH_BASE;
use register_map::{Board, update::Slot};
use sha2::{Digest as _, Sha256};

use crate::build::Program;
use crate::error::usage;
use crate::image::Elf;
use crate::toolchain::TARGET;
use crate::workspace::Workspace;
use crate::{build, command, flash, hex, image, keys, signed};

mod notices;
mod paths;
mod programs;
mod sbom;

use notices::Notices;
use paths::Paths;

/// What to build, and where to write it.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// An empty or new directory for the files [default: target/dist, which is emptied first]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Build only if this is the tag of the sources' version and no file differs from the commit
    #[arg(long, value_name = "TAG")]
    tag: Option<String>,

    /// Build only the programs, with loader and images of this directory in the simulator; this needs no key
    #[arg(long, value_name = "DIR")]
    images: Option<PathBuf>,

    #[command(flatten)]
    keys: keys::Release,

    /// Security epoch of the images
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    epoch: u16,

    /// Take the signatures from the files BOARD.modio of this directory, those of a release, instead of signing: to
    /// build the same bytes without the key
    #[arg(long, value_name = "DIR", conflicts_with_all = ["images", "key", "epoch"])]
    signed: Option<PathBuf>,
}

/// What signs the images.
enum Signer {
    Key(SigningKey, u16),
    /// A directory with the signed images of the same sources, and the public keys.
    Signed(PathBuf, [VerifyingKey; 2]),
}

/// The tag of this version. All packages have the workspace's version.
const TAG: &str = concat!("v", env!("CARGO_PKG_VERSION"));

/// `cargo xtask dist`.
pub fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    if let Some(tag) = &options.tag {
        check_tag(tag, register_map::commit!())?;
    }
    // Before the builds, which take long.
    let signer = match options.images {
        None => {
            let (public, file) = options.keys.public(workspace)?;
            let signer = match &options.signed {
                Some(directory) => Signer::Signed(directory.clone(), public),
                None => Signer::Key(options.keys.private(workspace, &public)?, options.epoch),
            };
            Some((signer, file))
        }
        Some(_) => None,
    };
    let standard = workspace.target.join("dist");
    if options.out.is_none() {
        let _ = fs::remove_dir_all(&standard);
    }
    let out = std::path::absolute(options.out.as_ref().unwrap_or(&standard))?;
    fs::create_dir_all(&out)?;
    if fs::read_dir(&out)?.next().is_some() {
        return Err(usage(format!("{} is not empty", out.display())));
    }
    let paths = Paths::of(workspace)?;
    let target = programs::target(&rustc(&["--print", "host-tuple"])?);
    let workspace = &mut paths.reproducible(workspace, &target);
    let mut notices = Notices::default();
    if let Some((signer, public)) = signer {
        workspace.keys = Some(public);
        for board in Board::ALL {
            let mut release = Release {
                workspace: &mut *workspace,
                board,
                out: &out,
                paths: &paths,
                notices: &mut notices,
            };
            release.files(&signer)?;
        }
        let root = &workspace.root;
        for name in ["LICENSE-APACHE", "LICENSE-MIT"] {
            fs::copy(root.join(name), out.join(name))?;
        }
        let sysroot = rustc(&["--print", "sysroot"])?;
        let library = Path::new(&sysroot).join("share/doc/rust/COPYRIGHT-library.html");
        fs::copy(library, out.join("THIRD-PARTY-rust-std.html"))?;
        let changes = fs::read_to_string(root.join("CHANGELOG.md"))?;
        let section = section(&changes, env!("CARGO_PKG_VERSION"))?;
        fs::write(out.join("RELEASE-NOTES.md"), section)?;
    }
    let images = options.images.as_ref().unwrap_or(&out);
    programs::files(workspace, &target, images, &out, &mut notices)?;
    notices.write(&target, &out)?;
    let sums = sums(&out)?;
    fs::write(out.join("SHA256SUMS"), &sums)?;
    say!("{sums}{}", out.join("SHA256SUMS").display());
    Ok(())
}

/// Refuses a tag of another version, and sources that no commit has.
fn check_tag(tag: &str, commit: &str) -> Result<()> {
    if tag != TAG {
        return Err(usage(format!(
            "the tag {tag} is not the tag of these sources, {TAG}"
        )));
    }
    if commit.ends_with("-dirty") || commit == "unknown" {
        return Err(usage(format!(
            "the commit of these sources is {commit}; a tag needs a commit without changes"
        )));
    }
    Ok(())
}

/// The files of a board.
struct Release<'a> {
    workspace: &'a mut Workspace,
    board: &'static Board,
    out: &'a Path,
    paths: &'a Paths,
    notices: &'a mut Notices,
}

impl Release<'_> {
    /// Makes the files: the image that runs alone, the loader, the application for both slots, the file of an update,
    /// and loader and slot A for a programmer.
    fn files(&mut self, signer: &Signer) -> Result<()> {
        let board = self.board;
        let (alone, entry) = self.program(Program::Alone, board.name)?;
        self.write(
            &format!("{board}.hex"),
            hex::file(&[(FLASH_BASE, alone.clone())], entry)?,
        )?;
        self.write(&format!("{board}.bin"), alone)?;
        let (loader, entry) = self.program(Program::Loader, &format!("{board}-loader"))?;
        let mut images = Vec::new();
        for (slot, letter) in Slot::ALL.into_iter().zip(["a", "b"]) {
            let name = format!("{board}-{letter}");
            self.program(Program::Slot(slot), &name)?;
            let elf = fs::read(self.out.join(format!("{name}.elf")))?;
            let mut image = signed::unsigned(board, slot, &elf)?;
            match signer {
                Signer::Key(key, epoch) => signed::sign(&mut image, key, *epoch),
                Signer::Signed(directory, public) => {
                    let file = directory.join(format!("{board}.modio"));
                    let images = signed::images(&fs::read(&file)?);
                    let signed = images.and_then(|images| {
                        signed::sign_as(&mut image, &images[slot as usize], public)
                    });
                    signed.with_context(|| file.display().to_string())?;
                }
            }
            images.push(image);
        }
        let [a, b]: [Vec<u8>; 2] = images.try_into().ok().context("two slots")?;
        let complete = flash::loaded(board, Slot::A, loader, a.clone());
        self.write(
            &format!("{board}-complete.hex"),
            hex::file(&complete, entry)?,
        )?;
        self.write(&format!("{board}.modio"), signed::file(&[a, b]))
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

/// Returns the section of a version in a changelog, without its heading.
fn section<'a>(changes: &'a str, version: &str) -> Result<&'a str> {
    let mut sections = changes.split("\n## ");
    let found = sections.find_map(|section| {
        let (heading, text) = section.split_once('\n')?;
        let text = text.trim_start();
        (heading.split_whitespace().next() == Some(version) && !text.is_empty()).then_some(text)
    });
    found.with_context(|| format!("CHANGELOG.md has no section \"## {version}\" with a text"))
}

/// Returns the sums of all files in a directory, in the order of their names, as `sha256sum` writes them.
fn sums(directory: &Path) -> Result<String> {
    let mut sums = Vec::new();
    for file in fs::read_dir(directory)? {
        let file = file?;
        let name = file.file_name().to_string_lossy().into_owned();
        sums.push((name, sha256(&fs::read(file.path())?)));
    }
    sums.sort_unstable();
    let lines = sums.iter().map(|(name, sum)| format!("{sum}  {name}\n"));
    Ok(lines.collect())
}

/// Returns what the rustc for this machine prints.
fn rustc(arguments: &[&str]) -> Result<String> {
    let printed = command::read(Command::new("rustc").args(arguments))?;
    Ok(printed.trim_end().to_owned())
}

fn sha256(content: &[u8]) -> String {
    format!("{:x}", Sha256::digest(content))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_sha256sum_in_the_order_of_names() {
        let directory = tempfile::tempdir().unwrap();
        fs::write(directory.path().join("b"), "abc").unwrap();
        fs::write(directory.path().join("a"), "").unwrap();
        let text = sums(directory.path()).unwrap();
        // The examples of FIPS 180-4 and of an empty file.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        let empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
        assert_eq!(text, format!("{empty}  a\n{abc}  b\n"));
    }

    #[test]
    fn release_notes_are_the_section_of_the_version() {
        let changes = "# Changelog\n\n## Unreleased\n\n## 0.2.0 - 2026-11-23\n\n### Added\n\n- A.\n\n## 0.1.0\n\n- B.\n";
        assert_eq!(section(changes, "0.2.0").unwrap(), "### Added\n\n- A.\n");
        assert_eq!(section(changes, "0.1.0").unwrap(), "- B.\n");
        for absent in ["0.2", "Unreleased"] {
            assert!(section(changes, absent).is_err(), "{absent}");
        }
        let changes = include_str!("../../CHANGELOG.md");
        assert!(section(changes, env!("CARGO_PKG_VERSION")).is_ok());
    }

    #[test]
    fn tag_needs_its_version_and_a_commit_without_changes() {
        assert!(check_tag(TAG, "1a2b3c4d").is_ok());
        for (tag, commit) in [
            ("v9.9.9", "1a2b3c4d"),
            (TAG, "1a2b3c4d-dirty"),
            (TAG, "unknown"),
        ] {
            assert!(check_tag(tag, commit).is_err(), "{tag} {commit}");
        }
    }
}
