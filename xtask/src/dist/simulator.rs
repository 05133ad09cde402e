//! The simulator as a program that runs without Rust and contains the images of all boards, and as a container image.

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use fs_err as fs;
use object::build::elf::Builder;
use register_map::Board;

use super::{oci, tool};
use crate::image;
use crate::workspace::Workspace;

/// Builds the simulator with the images `BOARD.elf` of a directory in it, writes it there, and returns the names of the
/// files.
pub fn files(workspace: &Workspace, out: &Path) -> Result<Vec<String>> {
    let images = workspace.target().join("dist-images");
    // Images of an earlier build would be included as well.
    let _ = fs::remove_dir_all(&images);
    fs::create_dir_all(&images)?;
    for board in Board::ALL {
        let name = format!("{board}.elf");
        let elf = stripped(&image::read(&out.join(&name))?)?;
        fs::write(images.join(name), elf)?;
    }
    let (file, name) = tool(workspace, "sim", "modio-sim", |cargo| {
        // The variable that tools/sim/build.rs reads.
        cargo.env("MODIO_SIM_IMAGES", &images);
    })?;
    fs::copy(&file, out.join(&name))?;
    let mut names = vec![name.clone()];
    let processor = name.trim_start_matches("modio-sim-").split('-').next();
    if let Some(processor) = processor.filter(|_| name.ends_with("-linux-musl")) {
        let archive = "modio-sim-oci.tar".to_owned();
        fs::write(
            out.join(&archive),
            oci::archive(&fs::read(&file)?, processor)?,
        )?;
        names.push(archive);
    }
    Ok(names)
}

/// Returns an image without debug information. Its symbols remain, because the simulator uses them to find the log.
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
    fn stripped_image_loses_its_debug_information_only() {
        let elf = image::sample::elf(
            &[image::sample::code(image::FLASH_BASE, &[1, 2, 3, 4])],
            &[],
        );
        let mut builder = Builder::read32(&*elf).unwrap();
        let debug = builder.sections.add();
        debug.name = b".debug_info"[..].into();
        debug.sh_type = object::elf::SHT_PROGBITS;
        debug.sh_addralign = 1;
        debug.data = object::build::elf::SectionData::Data(vec![7; 5000].into());
        builder.set_section_sizes();
        let mut with_debug = Vec::new();
        builder.write(&mut with_debug).unwrap();
        let has_debug = |elf: &[u8]| {
            let elf = image::parse(elf).unwrap();
            let mut sections = elf.sections();
            sections.any(|section| section.name() == Ok(".debug_info") && section.size() > 0)
        };
        assert!(has_debug(&with_debug));
        let stripped = stripped(&with_debug).unwrap();
        assert!(!has_debug(&stripped) && stripped.len() < with_debug.len() - 5000);
    }
}
