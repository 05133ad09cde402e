//! `cargo xtask dist`: all files of a release in one directory.
//!
//! | file | for |
//! |---|---|
//! | `modio.elf` | a debugger, probe-rs, the simulator |
//! | `modio.bin`, `modio.hex` | a programmer |
//! | `modio.map` | finding what an address is, what takes how much |
//! | `modio.cdx.json` | the crates in the image, as a CycloneDX bill of materials |
//! | `SHA256SUMS` | `sha256sum --check SHA256SUMS` |
//!
//! The same sources and toolchain give the same .bin, .hex and bill in whatever directory and at whatever time.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use sha2::{Digest as _, Sha256};

use crate::workspace::Workspace;
use crate::{Failure, Result, build, image};

mod hex;
mod sbom;

/// What to build, and where it goes.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    #[command(flatten)]
    build: build::Options,

    /// The directory for the files [default: target/dist]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Build only if this is the tag of the version that the sources have
    #[arg(long, value_name = "TAG")]
    tag: Option<String>,
}

/// The tag of this version; all packages have the workspace's.
const TAG: &str = concat!("v", env!("CARGO_PKG_VERSION"));

/// `cargo xtask dist`.
///
/// # Errors
///
/// When the image does not build, a dependency is not known to cargo, or a file cannot be written.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    check_tag(options.tag.as_deref())?;
    let out = match &options.out {
        // The linker runs elsewhere.
        Some(out) => std::path::absolute(out)
            .map_err(|error| Failure::asked(format!("{}: {error}", out.display())))?,
        None => workspace.target().join("dist"),
    };
    fs::create_dir_all(&out)
        .map_err(|error| Failure::new(format!("cannot make {}: {error}", out.display())))?;
    let map = out.join("modio.map");
    // A linker that writes none must not leave that of another image.
    let _ = fs::remove_file(&map);
    let built = build::image_with_map(workspace, &options.build, &map)?;
    if !map.is_file() {
        return Err(Failure::new("the linker has written no map"));
    }
    let elf = image::read(&built.elf)?;
    let flash = image::read(&built.bin)?;
    let entry = image::entry(&elf).map_err(Failure::new)?;
    let bill = sbom::of_image(workspace, &elf, &sha256(&flash))?;
    let mut names = vec!["modio.map"];
    for (name, content) in [
        ("modio.elf", elf),
        ("modio.bin", flash.clone()),
        ("modio.hex", hex::file(&flash, entry)?.into_bytes()),
        ("modio.cdx.json", format!("{bill:#}\n").into_bytes()),
    ] {
        write(&out.join(name), &content)?;
        names.push(name);
    }
    names.sort_unstable();
    write(&out.join("SHA256SUMS"), sums(&out, &names)?.as_bytes())?;
    for name in names {
        say!("{}", out.join(name).display());
    }
    say!("{}", out.join("SHA256SUMS").display());
    Ok(())
}

fn check_tag(tag: Option<&str>) -> Result<()> {
    match tag {
        Some(tag) if tag != TAG => {
            let what = format!("the tag {tag} is not that of these sources: {TAG}");
            Err(Failure::asked(what))
        }
        _ => Ok(()),
    }
}

fn write(path: &Path, content: &[u8]) -> Result<()> {
    fs::write(path, content)
        .map_err(|error| Failure::new(format!("cannot write {}: {error}", path.display())))
}

/// The sums of these files, as `sha256sum` writes them.
fn sums(directory: &Path, names: &[&str]) -> Result<String> {
    let mut text = String::new();
    for name in names {
        let content = fs::read(directory.join(name))
            .map_err(|error| Failure::new(format!("cannot read {name}: {error}")))?;
        // A String takes everything.
        let _ = writeln!(text, "{}  {name}", sha256(&content));
    }
    Ok(text)
}

fn sha256(content: &[u8]) -> String {
    let digest = Sha256::digest(content);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_release_has_the_tag_of_its_version() {
        assert_eq!(check_tag(None), Ok(()));
        assert_eq!(check_tag(Some(TAG)), Ok(()));
        for tag in ["v99.0.0", &TAG[1..], ""] {
            let failure = check_tag(Some(tag)).unwrap_err();
            assert!(failure.to_string().contains(TAG), "{failure}");
        }
    }

    #[test]
    fn sums_are_those_of_sha256sum() {
        let directory = tempfile::tempdir().unwrap();
        fs::write(directory.path().join("a"), "abc").unwrap();
        let text = sums(directory.path(), &["a"]).unwrap();
        // FIPS 180-4's example.
        let sum = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(text, format!("{sum}  a\n"));
        assert!(sums(directory.path(), &["b"]).is_err());
    }
}
