//! The programs of a release. They run without Rust and without this repository; the simulator contains the loaders and
//! images of all boards.
//!
//! On Linux they are linked with musl, so that they need no library of the system and run on every distribution.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use fs_err as fs;
use object::build::elf::Builder;
use register_map::Row;

use super::notices::Notices;
use super::{rustc, sbom, sha256};
use crate::image;
use crate::toolchain::Machine;
use crate::workspace::{self, Workspace};

/// Packages, and their programs.
const PROGRAMS: [(&str, &str); 3] = [
    ("modioctl", "modioctl"),
    ("sim", "modio-sim"),
    ("conformance", "modio-conformance"),
];

/// Builds the programs for a target, the simulator with the loaders and images of a directory in it, and writes them and
/// their bills of materials.
pub fn files(
    workspace: &Workspace,
    target: &str,
    images: &Path,
    out: &Path,
    notices: &mut Notices,
) -> Result<()> {
    let inside = workspace.target.join("images");
    // Images of an earlier build would be included as well.
    let _ = fs::remove_dir_all(&inside);
    fs::create_dir_all(&inside)?;
    for board in Row::ALL {
        for name in [format!("{board}.elf"), format!("{board}-loader.elf")] {
            let elf = stripped(&image::read(&images.join(&name))?)?;
            fs::write(inside.join(name), elf)?;
        }
        let update = format!("{board}.modio");
        fs::copy(images.join(&update), inside.join(update))?;
    }
    Machine::default().add(target)?;
    let mut cargo = workspace.cargo("build");
    cargo.args(["--ignore-rust-version", "--profile", "tool"]);
    cargo.args(["--target", target, "--target-dir"]);
    cargo.arg(&workspace.target);
    for (package, program) in PROGRAMS {
        cargo.args(["--package", package, "--bin", program]);
    }
    // The variable that tools/sim/build.rs reads.
    cargo.env("MODIO_SIM_IMAGES", &inside);
    let artifacts = workspace::artifacts(&mut cargo)?;
    let compiled = workspace::packages(&artifacts, &[workspace.target.join(target)]);
    let version = rustc(&["--version"])?;
    for (package, program) in PROGRAMS {
        let built = workspace::executable(&artifacts, program)?;
        let name = format!("{program}-{target}");
        let subject = sbom::Subject {
            name: program,
            kind: "application",
            package,
            target,
            features: String::new(),
            compiled: &compiled,
            compiler: version.trim_start_matches("rustc "),
            sha256: sha256(&fs::read(&built)?),
        };
        let bill = subject.bill(workspace, notices)?;
        fs::write(out.join(format!("{name}.cdx.json")), bill)?;
        fs::copy(built, out.join(name + std::env::consts::EXE_SUFFIX))?;
    }
    Ok(())
}

/// Returns the target for which programs for machines like `host` are built.
pub fn target(host: &str) -> String {
    match host.split_once("-unknown-linux-") {
        Some((processor, _)) => format!("{processor}-unknown-linux-musl"),
        None => host.to_owned(),
    }
}

/// Returns an image without debug information.
fn stripped(elf: &[u8]) -> Result<Vec<u8>> {
    let mut builder = Builder::<'_>::read32(elf).context("cannot strip the image")?;
    for section in &mut builder.sections {
        section.delete = section.name.starts_with(b".debug_");
    }
    let mut stripped = Vec::new();
    builder
        .write(&mut stripped)
        .context("cannot strip the image")?;
    let symbols = |elf| Ok::<_, anyhow::Error>(image::symbols(&image::parse(elf)?)?.len());
    ensure!(
        image::flat(&stripped, u32::MAX)? == image::flat(elf, u32::MAX)?
            && symbols(&stripped)? == symbols(elf)?,
        "stripping has changed the image"
    );
    Ok(stripped)
}

#[cfg(test)]
mod tests {
    use object::{Object as _, ObjectSection as _};

    use super::*;

    #[test]
    fn program_for_linux_needs_no_library_of_the_system() {
        for (host, expected) in [
            ("aarch64-unknown-linux-gnu", "aarch64-unknown-linux-musl"),
            ("x86_64-pc-windows-msvc", "x86_64-pc-windows-msvc"),
            ("aarch64-apple-darwin", "aarch64-apple-darwin"),
        ] {
            assert_eq!(target(host), expected);
        }
    }

    #[test]
    fn stripped_image_loses_its_debug_information_only() {
        let code = image::sample::code(image::FLASH_BASE, &[1, 2, 3, 4]);
        let elf = image::sample::elf(&[code], &[("main", image::FLASH_BASE, 4)]);
        let names = |elf: &[u8]| {
            let elf = image::parse(elf).unwrap();
            let names = elf
                .sections()
                .map(|section| section.name().unwrap().to_owned());
            names.collect::<Vec<_>>()
        };
        let (before, after) = (names(&elf), names(&stripped(&elf).unwrap()));
        assert_eq!(
            before,
            [".text", ".debug_str", ".symtab", ".strtab", ".shstrtab"]
        );
        assert_eq!(after, [".text", ".symtab", ".strtab", ".shstrtab"]);
    }
}
