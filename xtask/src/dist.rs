//! `cargo xtask dist`: all files of a release in one directory. docs/releasing.md lists them.
//!
//! On Linux the same commit and the same rustc give the same bytes in any directory and at any time: see [`paths`].

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::Result;
use ed25519_dalek::SigningKey;
use fs_err as fs;
use register_map::Row;
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
use signing::SUMS;

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
enum Signer<'a> {
    /// Nothing: the bytes to be signed are written.
    Nobody,
    Key(SigningKey),
    /// A directory with the signed images of the same sources, and the public keys.
    Signed(PathBuf, &'a keys::Pair),
}

/// `cargo xtask dist`.
pub fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    // Before the builds, which take long.
    let sources = workspace.sources()?;
    tag::check_commit(&workspace.root, &sources)?;
    if let Some(tag) = &options.tag {
        tag::check(&workspace.root, tag, &sources, options.epoch_jump)?;
    }
    let notes = notes(&workspace.root, &sources)?;
    let keys = match options.images {
        None => Some(options.keys.public(workspace)?),
        Some(_) => None,
    };
    let signer = match (&keys, &options.signed) {
        (Some((pair, _)), Some(directory)) => Signer::Signed(directory.clone(), pair),
        (Some((pair, _)), None) if !options.unsigned && options.files.is_none() => {
            Signer::Key(options.keys.private(workspace, pair)?)
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
    match (&keys, &options.files, &options.signatures) {
        (Some((pair, _)), Some(files), Some(signatures)) => {
            signing::finish(files, signatures, &sources, (pair, &options.keys), &out)?;
        }
        (Some((_, file)), ..) => {
            workspace.keys = Some(file.clone());
            for board in Row::ALL {
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
            texts(workspace, &notes, &out)?;
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
fn texts(workspace: &Workspace, notes: &str, out: &Path) -> Result<()> {
    let root = &workspace.root;
    for name in ["LICENSE-APACHE", "LICENSE-MIT"] {
        fs::copy(root.join(name), out.join(name))?;
    }
    let sysroot = rustc(&["--print", "sysroot"])?;
    let library = Path::new(&sysroot).join("share/doc/rust/COPYRIGHT-library.html");
    fs::copy(library, out.join("THIRD-PARTY-rust-std.html"))?;
    Ok(fs::write(out.join("RELEASE-NOTES.md"), notes)?)
}

/// Returns the section of the sources' version in the changelog. Between two releases that is "Unreleased".
fn notes(root: &Path, sources: &Sources) -> Result<String> {
    let changes = fs::read_to_string(root.join("CHANGELOG.md"))?;
    let version = &sources.version;
    if version.pre.is_empty() {
        let heading = version.to_string();
        return section(&changes, &heading)
            .filter(|text| !text.is_empty())
            .map(str::to_owned)
            .ok_or_else(|| {
                usage(format!(
                    "CHANGELOG.md has no section \"## {heading}\" with a text"
                ))
            });
    }
    Ok(section(&changes, "Unreleased")
        .unwrap_or_default()
        .to_owned())
}

/// Writes and shows the check sums of all files.
fn write_sums(out: &Path) -> Result<()> {
    let sums = sums(out)?;
    let file = out.join(SUMS);
    fs::write(&file, &sums)?;
    say!("{sums}{}", file.display());
    Ok(())
}

/// Returns the section with this heading in a changelog, without the heading.
fn section<'a>(changes: &'a str, heading: &str) -> Option<&'a str> {
    let mut sections = changes.split("\n## ");
    sections.find_map(|section| {
        let (first, text) = section.split_once('\n')?;
        (first.split_whitespace().next() == Some(heading)).then_some(text.trim_start())
    })
}

/// Returns the sums of all other files in a directory, in the order of their names, as `sha256sum` writes them.
fn sums(directory: &Path) -> Result<String> {
    let mut sums = Vec::new();
    for file in fs::read_dir(directory)? {
        let file = file?;
        let name = file.file_name().to_string_lossy().into_owned();
        if name != SUMS {
            sums.push((name, sha256(&fs::read(file.path())?)));
        }
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
        fs::write(directory.path().join("SHA256SUMS"), "sums").unwrap();
        let text = sums(directory.path()).unwrap();
        // The examples of FIPS 180-4 and of an empty file.
        let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        let empty = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
        assert_eq!(text, format!("{empty}  a\n{abc}  b\n"));
    }

    #[test]
    fn release_notes_are_the_section_of_the_version_and_before_it_what_is_unreleased() {
        let directory = tempfile::tempdir().unwrap();
        let of = |version: &str, changes: &str| {
            fs::write(directory.path().join("CHANGELOG.md"), changes).unwrap();
            let sources = Sources {
                version: version.parse().unwrap(),
                commit: String::new(),
                epoch: 0,
            };
            notes(directory.path(), &sources)
        };
        let changes = "# Changelog\n\n## Unreleased\n\n## 0.2.0 - 2026-11-23\n\n### Added\n\n- A.\n\n## 0.1.0\n\n- B.\n";
        assert_eq!(of("0.2.0", changes).unwrap(), "### Added\n\n- A.\n");
        assert_eq!(of("0.1.0", changes).unwrap(), "- B.\n");
        assert_eq!(of("0.3.0-dev", changes).unwrap(), "");
        let begun = changes.replace("## Unreleased\n", "## Unreleased\n\n- C.\n");
        assert_eq!(of("0.3.0-dev", &begun).unwrap(), "- C.\n");
        for absent in ["0.3.0", "0.2.1"] {
            assert!(of(absent, changes).is_err(), "{absent}");
        }
        assert!(of("0.2.0", "## 0.2.0\n\n## 0.1.0\n\n- B.\n").is_err());
    }
}
