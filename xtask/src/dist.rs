//! `cargo xtask dist`: all files of a release in one directory.
//!
//! | file, for each board | for |
//! |---|---|
//! | `modio-02.elf` | a debugger, probe-rs, the simulator |
//! | `modio-02.bin`, `modio-02.hex` | a programmer |
//! | `modio-02.map` | addresses and sizes of what is in the image |
//! | `modio-02.cdx.json` | the crates in the image, as a CycloneDX bill of materials |
//!
//! Besides, there are `modioctl-TARGET`, the host tool for machines like this one, and `modio-sim-TARGET`, the
//! simulator with the images of all boards inside. `modio-sim-oci.tar`, made on Linux, is that simulator as a
//! container image.
//!
//! `SHA256SUMS` has the check sums of all of them: `sha256sum --check SHA256SUMS`.
//!
//! The same sources and toolchain give the same .bin, .hex and bill in any directory and at any time.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, ensure};
use fs_err as fs;
use object::Object as _;
use register_map::Board;
use sha2::{Digest as _, Sha256};

use crate::error::usage;
use crate::workspace::{self, MESSAGES, Workspace};
use crate::{build, command, image, toolchain};

mod hex;
mod oci;
mod sbom;
mod simulator;

/// What to build, and where to write it.
#[derive(clap::Args, Clone, Debug)]
#[group(skip)]
pub struct Options {
    /// The directory for the files [default: target/dist]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Build only if this is the tag of the sources' version
    #[arg(long, value_name = "TAG")]
    tag: Option<String>,

    /// Only the host tool, for machines like this one
    #[arg(long)]
    tool: bool,
}

/// The tag of this version. All packages have the workspace's version.
const TAG: &str = concat!("v", env!("CARGO_PKG_VERSION"));

/// `cargo xtask dist`.
pub fn run(workspace: &mut Workspace, options: &Options) -> Result<()> {
    if let Some(tag) = options.tag.as_ref().filter(|tag| *tag != TAG) {
        return Err(usage(format!(
            "the tag {tag} is not the tag of these sources, {TAG}"
        )));
    }
    let out = match &options.out {
        // The linker runs in another directory.
        Some(out) => std::path::absolute(out)?,
        None => workspace.target().join("dist"),
    };
    fs::create_dir_all(&out)?;
    let mut names = Vec::new();
    if !options.tool {
        for board in Board::ALL {
            names.extend(files(workspace, board, &out)?);
        }
        names.extend(simulator::files(workspace, &out)?);
    }
    let (file, name) = tool(workspace, "modioctl", "modioctl", |_| ())?;
    fs::copy(&file, out.join(&name))?;
    names.push(name);
    fs::write(out.join("SHA256SUMS"), sums(&out, &names)?)?;
    for name in names.iter().map(String::as_str).chain(["SHA256SUMS"]) {
        say!("{}", out.join(name).display());
    }
    Ok(())
}

/// Makes the files of a board. Returns their names in alphabetical order.
fn files(workspace: &mut Workspace, board: &Board, out: &Path) -> Result<Vec<String>> {
    let named = |extension: &str| format!("{board}.{extension}");
    let map = out.join(named("map"));
    // A map of an earlier image must not remain when the linker writes none.
    let _ = fs::remove_file(&map);
    let built = build::image_with_map(workspace, board, &map)?;
    ensure!(map.is_file(), "the linker has written no map");
    let elf = image::read(&built.elf)?;
    let flash = image::read(&built.bin)?;
    let entry = image::parse(&elf)?.entry() as u32;
    let bill = sbom::of_image(workspace, board, &built, &sha256(&flash))?;
    let mut names = vec![named("map")];
    for (extension, content) in [
        ("elf", elf),
        ("hex", hex::file(&flash, entry)?.into_bytes()),
        ("bin", flash),
        ("cdx.json", format!("{bill:#}\n").into_bytes()),
    ] {
        fs::write(out.join(named(extension)), &content)?;
        names.push(named(extension));
    }
    names.sort_unstable();
    Ok(names)
}

/// Builds a package's program so that it runs without Rust and without this repository. Returns its file, and its name
/// in a release.
///
/// On Linux it is linked with musl, so that it needs no library of the system and runs on every distribution.
fn tool(
    workspace: &Workspace,
    package: &str,
    program: &str,
    with: impl FnOnce(&mut Command),
) -> Result<(PathBuf, String)> {
    let target = tool_target(&host()?);
    toolchain::add(workspace.root(), &target)?;
    let mut cargo = workspace.cargo("build");
    cargo.args(["--locked", "--ignore-rust-version", "--profile", "tool"]);
    cargo.args([
        "--package",
        package,
        "--bin",
        program,
        "--target",
        &target,
        MESSAGES,
    ]);
    with(&mut cargo);
    let file = workspace::executable(&workspace::artifacts(&mut cargo)?, program)?;
    let suffix = std::env::consts::EXE_SUFFIX;
    Ok((file, format!("{program}-{target}{suffix}")))
}

/// Returns the target of this machine.
pub fn host() -> Result<String> {
    let version = command::read(Command::new("rustc").arg("-vV"))?;
    let host = version.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host
        .context("rustc does not report the target of this machine")?
        .to_owned())
}

/// Returns the target for which programs for a machine are built.
fn tool_target(host: &str) -> String {
    match host.split_once("-unknown-linux-") {
        Some((processor, _)) => format!("{processor}-unknown-linux-musl"),
        None => host.to_owned(),
    }
}

/// Returns the sums of these files, as `sha256sum` writes them.
fn sums(directory: &Path, names: &[String]) -> Result<String> {
    let mut text = String::new();
    for name in names {
        let sum = sha256(&fs::read(directory.join(name))?);
        writeln!(text, "{sum}  {name}")?;
    }
    Ok(text)
}

fn sha256(content: &[u8]) -> String {
    format!("{:x}", Sha256::digest(content))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_those_of_sha256sum() {
        let directory = tempfile::tempdir().unwrap();
        fs::write(directory.path().join("a"), "abc").unwrap();
        let text = sums(directory.path(), &["a".to_owned()]).unwrap();
        // The example of FIPS 180-4.
        let sum = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(text, format!("{sum}  a\n"));
    }

    #[test]
    fn tool_for_linux_needs_no_library_of_the_system() {
        for (host, target) in [
            ("aarch64-unknown-linux-gnu", "aarch64-unknown-linux-musl"),
            ("x86_64-pc-windows-msvc", "x86_64-pc-windows-msvc"),
            ("aarch64-apple-darwin", "aarch64-apple-darwin"),
        ] {
            assert_eq!(tool_target(host), target);
        }
    }
}
