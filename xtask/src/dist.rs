//! `cargo xtask dist`: all files of a release in one directory.
//!
//! | file, for each board | for |
//! |---|---|
//! | `modio-02.elf` | a debugger, probe-rs, the simulator |
//! | `modio-02.bin`, `modio-02.hex` | a programmer |
//! | `modio-02.map` | finding what an address is, what takes how much |
//! | `modio-02.cdx.json` | the crates in the image, as a CycloneDX bill of materials |
//!
//! Beside them stand `modioctl-TARGET`, the host tool for machines like this one, and `modio-sim-TARGET`, the simulator
//! with the images of all boards inside. `modio-sim-oci.tar`, made on Linux, is that simulator as a container image.
//!
//! `SHA256SUMS` has the check sums of all of them: `sha256sum --check SHA256SUMS`.
//!
//! The same sources and toolchain give the same .bin, .hex and bill in whatever directory and at whatever time.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use register_map::Board;
use sha2::{Digest as _, Sha256};

use crate::workspace::Workspace;
use crate::{Failure, Result, build, image};

mod hex;
mod oci;
mod sbom;
mod simulator;
mod tool;

/// What to build, and where it goes.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// The directory for the files [default: target/dist]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Build only if this is the tag of the version that the sources have
    #[arg(long, value_name = "TAG")]
    tag: Option<String>,

    /// Only the host tool, for machines like this one
    #[arg(long)]
    tool: bool,
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
    let mut names = Vec::new();
    if !options.tool {
        for board in Board::ALL {
            names.extend(files(workspace, board, &out)?);
        }
        names.extend(simulator::files(workspace, &Board::ALL, &out)?);
    }
    let (file, name) = tool::build(workspace, "modioctl", "modioctl", |_| ())?;
    tool::copy(&file, &out.join(&name))?;
    names.push(name);
    write(&out.join("SHA256SUMS"), sums(&out, &names)?.as_bytes())?;
    for name in &names {
        say!("{}", out.join(name).display());
    }
    say!("{}", out.join("SHA256SUMS").display());
    Ok(())
}

/// Makes the files of a board. Returns their names in alphabetical order.
fn files(workspace: &mut Workspace, board: &Board, out: &Path) -> Result<Vec<String>> {
    let named = |extension: &str| format!("{board}.{extension}");
    let map = out.join(named("map"));
    // A linker that writes none must not leave that of another image.
    let _ = fs::remove_file(&map);
    let built = build::image_with_map(workspace, board, &map)?;
    if !map.is_file() {
        return Err(Failure::new("the linker has written no map"));
    }
    let elf = image::read(&built.elf)?;
    let flash = image::read(&built.bin)?;
    let entry = image::entry(&elf).map_err(Failure::new)?;
    let bill = sbom::of_image(workspace, board, &elf, &sha256(&flash))?;
    let hex = hex::file(&flash, entry)?;
    let mut names = vec![named("map")];
    for (extension, content) in [
        ("elf", elf),
        ("bin", flash),
        ("hex", hex.into_bytes()),
        ("cdx.json", format!("{bill:#}\n").into_bytes()),
    ] {
        write(&out.join(named(extension)), &content)?;
        names.push(named(extension));
    }
    names.sort_unstable();
    Ok(names)
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
fn sums(directory: &Path, names: &[String]) -> Result<String> {
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
        let text = sums(directory.path(), &["a".to_owned()]).unwrap();
        // FIPS 180-4's example.
        let sum = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(text, format!("{sum}  a\n"));
        assert!(sums(directory.path(), &["b".to_owned()]).is_err());
    }
}
