//! The image as an ELF file: the bytes that are written to flash, and the calls of its code.

use std::path::Path;

use anyhow::{Context as _, Result, bail, ensure};
use object::elf::{PT_LOAD, ProgramHeader32};
use object::read::elf::{ElfFile32, ProgramHeader as _};
use object::{Endianness, Object as _, ObjectSymbol as _, SymbolKind};

use crate::error::usage;

/// First address of flash.
pub const FLASH_BASE: u32 = 0x0800_0000;

/// First address of RAM.
pub const RAM_BASE: u32 = 0x2000_0000;

/// Start of the names that lld gives to thunks. The rest is the name of the function that the thunk jumps to.
const THUNK: &str = "__Thumbv7ABSLongThunk_";

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

/// Returns the path of a Rust symbol, without its hash.
pub fn demangled(name: &str) -> String {
    format!("{:#}", rustc_demangle::demangle(name))
}

/// Returns the functions in flash that code in RAM calls. A branch from RAM does not reach flash, so lld makes a thunk
/// for each such call and places it near the caller.
pub fn calls_from_ram(bytes: &[u8]) -> Result<Vec<String>> {
    let symbols = symbols(&parse(bytes)?)?;
    let in_ram = symbols.iter().filter(|symbol| symbol.address >= RAM_BASE);
    let called = in_ram.filter_map(|symbol| symbol.name.strip_prefix(THUNK));
    Ok(called.map(demangled).collect())
}

/// Returns the functions of `core::panicking` that are linked, and the panic handler, each with its direct callers.
///
/// Every panic of Rust calls one of them, and the linker keeps only functions that something can call.
pub fn panics(bytes: &[u8]) -> Result<Vec<(String, Vec<String>)>> {
    let functions: Vec<Symbol> = symbols(&parse(bytes)?)?
        .into_iter()
        .filter(|symbol| symbol.function)
        .map(|symbol| Symbol {
            name: demangled(&symbol.name),
            ..symbol
        })
        .collect();
    ensure!(
        !functions.is_empty(),
        "the image has no symbols, so it is unknown whether it can panic"
    );
    let flash = flat(bytes, u32::MAX)?;
    let panics = functions.iter().filter(|function| {
        function.name.starts_with("core::panicking::")
            || function.name.ends_with("rust_begin_unwind")
    });
    let with_callers = panics.map(|panic| {
        let calls = |function: &&Symbol| calls(function, &flash, panic.address);
        let callers = functions.iter().filter(calls);
        (
            panic.name.clone(),
            callers.map(|caller| caller.name.clone()).collect(),
        )
    });
    Ok(with_callers.collect())
}

/// Returns whether a function has a direct call to an address. Only functions in flash are searched.
fn calls(function: &Symbol, flash: &[u8], target: u32) -> bool {
    let start = function.address.wrapping_sub(FLASH_BASE) as usize;
    let code = flash.get(start..start.saturating_add(function.size as usize));
    let halves: Vec<u16> = code
        .unwrap_or_default()
        .chunks_exact(2)
        .map(|half| u16::from_le_bytes([half[0], half[1]]))
        .collect();
    let mut pairs = (function.address..).step_by(2).zip(halves.windows(2));
    pairs.any(|(at, pair)| branch(at, pair[0], pair[1]) == Some(target))
}

/// Returns the target of a BL or a B.W, encodings T1 and T4 (Armv7-M manual A7.7.18 and A7.7.12), or `None` for any
/// other pair of half-words.
fn branch(at: u32, first: u16, second: u16) -> Option<u32> {
    if first & 0xF800 != 0xF000 || second & 0x9000 != 0x9000 {
        return None;
    }
    let (first, second) = (u32::from(first), u32::from(second));
    let sign = first >> 10 & 1;
    let i1 = 1 ^ (second >> 13 & 1) ^ sign;
    let i2 = 1 ^ (second >> 11 & 1) ^ sign;
    let offset = sign << 24 | i1 << 23 | i2 << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1;
    // 25 bits with a sign.
    let offset = (offset << 7).cast_signed() >> 7;
    Some(at.wrapping_add(4).wrapping_add_signed(offset))
}

#[cfg(test)]
pub mod sample;
#[cfg(test)]
mod tests;
