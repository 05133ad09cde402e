//! `cargo xtask dist`: all files of a release in one directory. docs/releasing.md lists them.
//!
//! On Linux the same commit and the same rustc give the same bytes in any directory and at any time: see [`paths`].

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result};
use ed25519_dalek::{SigningKey, VerifyingKey};
use fs_err as fs;
use register_map::Board;
use sha2::{Digest as _, Sha256};

use crate::error::usage;
use crate::sources::Sources;
use crate::toolchain::TARGET;
use crate::workspace::Workspace;
use crate::{command, keys};

mod board;
mod notices;
mod paths;
mod programs;
mod sbom;
mod signing;
mod tag;

use notices::Notices;
use paths::Paths;

/// What to build, and where to write it.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// An empty or new directory for the files [default: target/dist, which is emptied first]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Build only if this is the tag of the sources' version, at this commit, and the security epoch follows that of the
    /// tag before
    #[arg(long, value_name = "TAG")]
    tag: Option<String>,

    /// Let --tag accept an epoch that is more than one higher than that of the tag before
    #[arg(long, requires = "tag")]
    epoch_jump: bool,

    /// Build only the programs, with loader and images of this directory in the simulator; this needs no key
    #[arg(long, value_name = "DIR")]
    images: Option<PathBuf>,

    #[command(flatten)]
    keys: keys::Release,

    /// Build everything but what needs a signature, and write the bytes to be signed, 92 in each file *.tbs; this needs
    /// no key
    #[arg(long, conflicts_with_all = ["images", "key", "signed", "signatures"])]
    unsigned: bool,

    /// Make the release from the files of --unsigned in DIR, with the signatures of --signatures; this needs no key
    #[arg(long, value_name = "DIR", requires = "signatures", conflicts_with_all = ["images", "key", "signed"])]
    files: Option<PathBuf>,

    /// The signatures, 64 bytes in each file *.sig
    #[arg(long, value_name = "DIR", requires = "files")]
    signatures: Option<PathBuf>,

    /// Take the signatures from the files BOARD.modio of this directory, those of a release, instead of signing: to
    /// build the same bytes without the key
    #[arg(long, value_name = "DIR", conflicts_with_all = ["images", "key"])]
    signed: Option<PathBuf>,
}

/// What signs the images.
enum Signer {
    /// Nothing: the bytes to be signed are written.
    Nobody,
    Key(SigningKey),
    /// A directory with the signed images of the same sources, and the public keys.
    Signed(PathBuf, [VerifyingKey; 2]),
}

/// `cargo xtask dist`.
pub fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    // Before the builds, which take long.
    let sources = workspace.sources()?;
    tag::check_commit(&sources)?;
    if let Some(tag) = &options.tag {
        tag::check(&workspace.root, tag, &sources, options.epoch_jump)?;
    }
    let keys = match options.images {
        None => Some(options.keys.public(workspace)?),
        Some(_) => None,
    };
    let signer = match (&keys, &options.signed) {
        (Some((public, _)), Some(directory)) => Signer::Signed(directory.clone(), *public),
        (Some((public, _)), None) if !options.unsigned && options.files.is_none() => {
            Signer::Key(options.keys.private(workspace, public)?)
        }
        _ => Signer::Nobody,
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
    match (keys, &options.files, &options.signatures) {
        (Some((public, _)), Some(files), Some(signatures)) => {
            signing::finish(files, signatures, &sources, (&public, &options.keys), &out)?;
        }
        (Some((_, file)), ..) => {
            workspace.keys = Some(file);
            for board in Board::ALL {
                let mut release = board::Files {
                    workspace: &mut *workspace,
                    sources: &sources,
                    board,
                    out: &out,
                    paths: &paths,
                    notices: &mut notices,
                };
                release.make(&signer)?;
            }
            // Those of the programs are in another file.
            core::mem::take(&mut notices).write(TARGET, &out)?;
            texts(workspace, &sources, &out)?;
            if options.unsigned {
                return write_sums(&out);
            }
        }
        _ => {}
    }
    let images = options.images.as_ref().unwrap_or(&out);
    programs::files(workspace, &target, images, &out, &mut notices)?;
    notices.write(&target, &out)?;
    write_sums(&out)
}

/// Writes licences and release notes.
fn texts(workspace: &Workspace, sources: &Sources, out: &Path) -> Result<()> {
    let root = &workspace.root;
    for name in ["LICENSE-APACHE", "LICENSE-MIT"] {
        fs::copy(root.join(name), out.join(name))?;
    }
    let sysroot = rustc(&["--print", "sysroot"])?;
    let library = Path::new(&sysroot).join("share/doc/rust/COPYRIGHT-library.html");
    fs::copy(library, out.join("THIRD-PARTY-rust-std.html"))?;
    let changes = fs::read_to_string(root.join("CHANGELOG.md"))?;
    let heading = match &sources.version {
        version if version.pre.is_empty() => version.to_string(),
        _ => "Unreleased".to_owned(),
    };
    let section = section(&changes, &heading)?;
    Ok(fs::write(out.join("RELEASE-NOTES.md"), section)?)
}

/// Writes and shows the check sums of all files.
fn write_sums(out: &Path) -> Result<()> {
    let sums = sums(out)?;
    fs::write(out.join("SHA256SUMS"), &sums)?;
    say!("{sums}{}", out.join("SHA256SUMS").display());
    Ok(())
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
    }
}
