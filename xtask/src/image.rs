//! The image as an ELF file: read, and turned into the bytes that go into flash.

pub mod panics;
pub mod ram_code;

use std::fs;
use std::path::Path;

use object::Endianness;
use object::elf::PT_LOAD;
use object::read::elf::{ElfFile32, ProgramHeader};

use crate::{Failure, Result};

/// Where flash begins.
pub const FLASH_BASE: u32 = 0x0800_0000;

/// Where RAM begins.
pub const RAM_BASE: u32 = 0x2000_0000;

/// An ELF file for a 32-bit microcontroller.
pub type Elf<'data> = ElfFile32<'data, Endianness>;

/// Reads a file that should be an image.
///
/// # Errors
///
/// When it cannot be read: the path and why; exit status 2.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).map_err(|error| {
        Failure::asked(format!("cannot read the image {}: {error}", path.display()))
    })
}

/// Takes an image apart.
///
/// # Errors
///
/// When it is no 32-bit ELF file.
pub fn parse(bytes: &[u8]) -> std::result::Result<Elf<'_>, String> {
    Elf::parse(bytes).map_err(|error| format!("the image is not a 32-bit ELF file: {error}"))
}

/// Where the program starts, as the ELF file says.
///
/// # Errors
///
/// When it is no 32-bit ELF file.
pub fn entry(bytes: &[u8]) -> std::result::Result<u32, String> {
    let elf = parse(bytes)?;
    Ok(elf.elf_header().e_entry.get(elf.endian()))
}

/// The bytes of flash from its beginning to the last that the image loads, as a programmer takes them.
/// Gaps between load segments are 0xFF, as erased.
///
/// # Errors
///
/// When it is no ELF file, loads nothing, or loads something outside a flash of `size` bytes.
pub fn flat(bytes: &[u8], size: u32) -> std::result::Result<Vec<u8>, String> {
    let elf = parse(bytes)?;
    let endian = elf.endian();
    let mut flash = Vec::new();
    for segment in elf.elf_program_headers() {
        let segment: &object::elf::ProgramHeader32<Endianness> = segment;
        let length = segment.p_filesz(endian);
        if segment.p_type(endian) != PT_LOAD || length == 0 {
            continue;
        }
        // The load address: initial values of variables stand in flash, too.
        let address = segment.p_paddr(endian);
        let data = segment
            .data(endian, bytes)
            .map_err(|()| format!("the segment at {address:#010x} is cut short"))?;
        let start = address
            .checked_sub(FLASH_BASE)
            .filter(|start| start.checked_add(length).is_some_and(|end| end <= size))
            .ok_or_else(|| format!("{length} bytes at {address:#010x} are not in flash"))?;
        let range = start as usize..(start + length) as usize;
        if flash.len() < range.end {
            flash.resize(range.end, 0xFF);
        }
        flash[range].copy_from_slice(data);
    }
    if flash.is_empty() {
        Err("the image loads nothing".to_owned())
    } else {
        Ok(flash)
    }
}

#[cfg(test)]
pub(crate) mod sample;

#[cfg(test)]
mod tests {
    use super::sample::Segment;
    use super::*;

    const FLASH_SIZE: u32 = 128 * 1024;

    fn flat(bytes: &[u8]) -> std::result::Result<Vec<u8>, String> {
        super::flat(bytes, FLASH_SIZE)
    }

    fn elf(segments: &[Segment]) -> Vec<u8> {
        sample::elf(segments, &[])
    }

    #[test]
    fn load_segments_are_put_where_they_load_with_erased_gaps() {
        let image = elf(&[
            Segment::at(FLASH_BASE, &[1, 2, 3]),
            Segment {
                load: FLASH_BASE + 8,
                run: RAM_BASE,
                data: &[4, 5],
                size: 16,
            },
        ]);
        let expected = [1, 2, 3, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 4, 5];
        assert_eq!(flat(&image).unwrap(), expected);
    }

    #[test]
    fn variables_without_initial_values_take_no_flash() {
        let image = elf(&[
            Segment::at(FLASH_BASE, &[1]),
            Segment {
                load: RAM_BASE,
                run: RAM_BASE,
                data: &[],
                size: 4096,
            },
        ]);
        assert_eq!(flat(&image).unwrap(), [1]);
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_address() {
        for address in [
            FLASH_BASE - 4,
            FLASH_BASE + FLASH_SIZE - 2,
            RAM_BASE,
            u32::MAX,
        ] {
            let text = flat(&elf(&[Segment::at(address, &[0; 4])])).unwrap_err();
            assert!(text.contains(&format!("{address:#010x}")), "{text}");
        }
        assert!(flat(&elf(&[Segment::at(FLASH_BASE + FLASH_SIZE - 4, &[0; 4])])).is_ok());
    }

    #[test]
    fn what_is_no_image_is_refused() {
        assert_eq!(flat(&elf(&[])).unwrap_err(), "the image loads nothing");
        assert!(flat(b"#!/bin/sh").unwrap_err().contains("not a 32-bit ELF"));
        let whole = elf(&[Segment::at(FLASH_BASE, &[7; 64])]);
        let start = whole
            .windows(64)
            .position(|bytes| bytes == [7; 64])
            .unwrap();
        assert!(flat(&whole[..start + 10]).is_err(), "cut short");
    }
}
