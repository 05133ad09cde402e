//! The image as an ELF file: the bytes that are written to flash, and the calls of its code.

use std::path::Path;

use anyhow::{Context as _, Result, bail, ensure};
use object::elf::{PT_LOAD, ProgramHeader32};
use object::read::elf::{ElfFile32, ProgramHeader as _};
use object::{Endianness, Object as _, ObjectSymbol as _, SymbolKind};

use crate::error::usage;

pub use register_map::part::{FLASH_BASE, RAM_BASE};

/// An ELF file for a 32-bit microcontroller.
pub type Elf<'data> = ElfFile32<'data, Endianness>;

/// Reads an image. A file that cannot be read is a usage error.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    fs_err::read(path).map_err(|error| usage(error.to_string()))
}

/// Parses an image.
pub fn parse(bytes: &[u8]) -> Result<Elf<'_>> {
    Elf::parse(bytes).context("the image is not a 32-bit ELF file")
}

/// Returns the bytes of flash from its first address to the last byte that the image loads. Gaps are 0xFF, as erased.
pub fn flat(bytes: &[u8], size: u32) -> Result<Vec<u8>> {
    let elf = parse(bytes)?;
    let endian = elf.endian();
    let mut flash = Vec::new();
    for segment in elf.elf_program_headers() {
        let segment: &ProgramHeader32<Endianness> = segment;
        let length = segment.p_filesz(endian);
        if segment.p_type(endian) != PT_LOAD || length == 0 {
            continue;
        }
        // The load address: initial values of variables are in flash, too.
        let address = segment.p_paddr(endian);
        let Ok(data) = segment.data(endian, bytes) else {
            bail!("the segment at {address:#010x} is cut short");
        };
        let start = address
            .checked_sub(FLASH_BASE)
            .filter(|start| start.checked_add(length).is_some_and(|end| end <= size))
            .with_context(|| format!("{length} bytes at {address:#010x} are not in flash"))?;
        let range = start as usize..(start + length) as usize;
        flash.resize(flash.len().max(range.end), 0xFF);
        flash[range].copy_from_slice(data);
    }
    ensure!(!flash.is_empty(), "the image loads nothing");
    Ok(flash)
}

/// A symbol of the image.
pub struct Symbol {
    /// Path in Rust, or the name in the linker script or of the hardware.
    pub name: String,
    /// Address without the Thumb bit.
    pub address: u32,
    /// Size in bytes.
    pub size: u32,
    /// Whether it is a function.
    pub function: bool,
}

/// Returns the symbols of an image.
pub fn symbols(elf: &Elf<'_>) -> Result<Vec<Symbol>> {
    elf.symbols()
        .map(|symbol| {
            let function = symbol.kind() == SymbolKind::Text;
            let name = symbol.name().context("the image is broken")?;
            Ok(Symbol {
                name: name.to_owned(),
                // Bit 0 of a function's address is the Thumb bit.
                address: symbol.address() as u32 & if function { !1 } else { !0 },
                size: symbol.size() as u32,
                function,
            })
        })
        .collect()
}

/// Refuses an image that can panic, or whose code in RAM uses flash.
pub fn check(bytes: &[u8]) -> Result<()> {
    let elf = parse(bytes)?;
    let symbols = symbols(&elf)?;
    panics::check(&elf, &symbols)?;
    ram_code::check(&elf, &symbols)
}

/// Returns the path of a Rust symbol, without its hash.
fn demangled(name: &str) -> String {
    format!("{:#}", rustc_demangle::demangle(name))
}

mod panics;
mod ram_code;
#[cfg(test)]
pub mod sample;
#[cfg(test)]
mod tests;
