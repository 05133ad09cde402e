//! The simulator as a file that runs without Rust, with the images of all boards inside, and as a container image.

use std::fs;
use std::path::Path;

use object::Endianness;
use object::build::elf::Builder;

use super::{oci, tool, write};
use crate::workspace::Workspace;
use crate::{Failure, Result, image};

/// The variable that names the directory of the images to tools/sim/build.rs.
const IMAGES: &str = "MODIO_SIM_IMAGES";

/// Builds the simulator with the images `BOARD.elf` of a directory inside, puts it there, and gives the names of the
/// files that are made.
///
/// # Errors
///
/// When it does not build, an image cannot be read, or a file cannot be written.
pub(super) fn files(
    workspace: &Workspace,
    boards: &[&register_map::Board],
    out: &Path,
) -> Result<Vec<String>> {
    let images = workspace.target().join("dist-images");
    // What an earlier build has left would be inside as well.
    let _ = fs::remove_dir_all(&images);
    fs::create_dir_all(&images)
        .map_err(|error| Failure::new(format!("cannot make {}: {error}", images.display())))?;
    for board in boards {
        let name = format!("{board}.elf");
        let elf = stripped(&image::read(&out.join(&name))?)?;
        write(&images.join(name), &elf)?;
    }
    let (file, name) = tool::build(workspace, "sim", "modio-sim", |cargo| {
        cargo.env(IMAGES, &images);
    })?;
    let program = fs::read(&file)
        .map_err(|error| Failure::new(format!("cannot read {}: {error}", file.display())))?;
    tool::copy(&file, &out.join(&name))?;
    let mut names = vec![name.clone()];
    let processor = name.trim_start_matches("modio-sim-").split('-').next();
    if let Some(processor) = processor.filter(|_| name.ends_with("-linux-musl")) {
        let archive = "modio-sim-oci.tar".to_owned();
        write(&out.join(&archive), &oci::archive(&program, processor)?)?;
        names.push(archive);
    }
    Ok(names)
}

/// An image without what only a debugger needs; its symbols stay, by which the simulator finds the log.
fn stripped(elf: &[u8]) -> Result<Vec<u8>> {
    let wrong =
        |error: object::build::Error| Failure::new(format!("cannot strip the image: {error}"));
    let mut builder = Builder::<'_>::read32(elf).map_err(wrong)?;
    for section in &mut builder.sections {
        section.delete = section.name.starts_with(b".debug_");
    }
    let mut stripped = Vec::new();
    builder.write(&mut stripped).map_err(wrong)?;
    // That nothing of what is loaded has changed is easily seen here, and badly later.
    let flash = |elf: &[u8]| image::flat(elf, u32::MAX).map_err(Failure::new);
    let symbols = |elf: &[u8]| -> Result<usize> {
        use object::{Object as _, read::elf::ElfFile32};
        let elf: ElfFile32<'_, Endianness> = image::parse(elf).map_err(Failure::new)?;
        Ok(elf.symbols().count())
    };
    if flash(&stripped)? != flash(elf)? || symbols(&stripped)? != symbols(elf)? {
        return Err(Failure::new("the stripped image is another one"));
    }
    Ok(stripped)
}

#[cfg(test)]
mod tests {
    use object::{Object as _, ObjectSection as _};

    use super::*;

    #[test]
    fn an_image_loses_its_debug_information_and_nothing_else() {
        // Any ELF file for 32 bits will do that has both.
        let segment = image::sample::Segment::at(image::FLASH_BASE, &[1, 2, 3, 4]);
        let elf = image::sample::elf(&[segment], &[]);
        let mut builder = Builder::read32(&*elf).unwrap();
        let debug = builder.sections.add();
        debug.name = b".debug_info"[..].into();
        debug.sh_type = object::elf::SHT_PROGBITS;
        debug.sh_addralign = 1;
        debug.data = object::build::elf::SectionData::Data(vec![7; 5000].into());
        builder.set_section_sizes();
        let mut with_debug = Vec::new();
        builder.write(&mut with_debug).unwrap();
        let names = |elf: &[u8]| -> Vec<String> {
            let elf = image::parse(elf).unwrap();
            let sections = elf.sections().filter(|section| section.size() > 0);
            sections
                .map(|section| section.name().unwrap().to_owned())
                .collect()
        };
        assert!(names(&with_debug).contains(&".debug_info".to_owned()));
        let stripped = stripped(&with_debug).unwrap();
        assert!(!names(&stripped).contains(&".debug_info".to_owned()));
        assert!(stripped.len() < with_debug.len() - 5000);
        assert!(super::stripped(b"#!/bin/sh").is_err());
    }
}
