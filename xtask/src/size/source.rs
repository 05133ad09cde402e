//! Data from the debug information of an image: the crate of an instruction, and the sizes of structures.
//!
//! Symbols do not have the crate of the code, because much of an optimised image is inlined into a few interrupt
//! handlers. Code of `core` that is inlined counts for the crate that uses it.

use std::collections::BTreeMap;

use addr2line::gimli::{self, Dwarf, EndianSlice, LittleEndian, constants};
use object::{Object as _, ObjectSection as _};

use crate::image::Elf;

/// The library that every crate uses.
const CORE: &str = "core";

type Reader<'data> = EndianSlice<'data, LittleEndian>;

/// Loads the debug information of an image, which may have none.
fn dwarf<'data>(elf: &Elf<'data>) -> gimli::Result<Dwarf<Reader<'data>>> {
    Dwarf::load(|id| {
        let section = elf.section_by_name(id.name());
        let data = section.and_then(|section| section.data().ok());
        Ok(EndianSlice::new(data.unwrap_or_default(), LittleEndian))
    })
}

/// The sources of an image's code.
pub struct Source<'data> {
    context: addr2line::Context<Reader<'data>>,
}

impl<'data> Source<'data> {
    /// Reads the debug information of an image. Without any, no address has a source.
    pub fn new(elf: &Elf<'data>) -> gimli::Result<Self> {
        let context = addr2line::Context::from_dwarf(dwarf(elf)?)?;
        Ok(Self { context })
    }

    /// Returns the ranges of code from `start` up to `end` that come from a known crate: address, bytes, crate.
    pub fn owners(&self, start: u32, end: u32) -> Vec<(u32, u32, String)> {
        let lines = self.context.find_location_range(start.into(), end.into());
        let lines = lines.into_iter().flatten();
        lines
            .filter_map(|(address, length, _)| {
                let address = u32::try_from(address).ok()?;
                let owner = self.owner(address)?;
                Some((address, u32::try_from(length).ok()?, owner))
            })
            .collect()
    }

    /// Returns the result of `of` for the innermost source file of the instruction at `address` for which it has one.
    pub fn innermost<T>(&self, address: u32, of: impl Fn(&str) -> Option<T>) -> Option<T> {
        let frames = self.context.find_frames(address.into()).skip_all_loads();
        let mut frames = frames.ok()?;
        while let Ok(Some(frame)) = frames.next() {
            let file = frame.location.and_then(|location| location.file);
            if let Some(found) = file.and_then(&of) {
                return Some(found);
            }
        }
        None
    }

    /// Returns the innermost crate but `core` of the instruction at `address`.
    fn owner(&self, address: u32) -> Option<String> {
        self.innermost(address, |file| crate_of(file).filter(|name| name != CORE))
            .or_else(|| self.innermost(address, crate_of))
    }
}

/// Returns the crate of a source file, from its path: the directory above `src`, without a version. For generated code
/// it is the package of the build script.
fn crate_of(path: &str) -> Option<String> {
    let parts: Vec<&str> = path.split(['/', '\\']).collect();
    let above = |name: &str| {
        let at = parts.iter().rposition(|part| *part == name)?;
        parts.get(at.checked_sub(1)?).copied()
    };
    let name = above("src").or_else(|| above("out"))?;
    // `serde-1.0.2`, or `serde-0a1b...` of target/.../build: a name, `-`, and something with a digit.
    let bare = match name.rsplit_once('-') {
        Some((bare, tail)) if tail.contains(|c: char| c.is_ascii_digit()) => bare,
        _ => name,
    };
    Some(bare.replace('-', "_"))
}

/// Returns the structures of a crate by name, in bytes. Of several with one name, the largest.
pub fn structures(elf: &Elf<'_>, krate: &str) -> gimli::Result<BTreeMap<String, u64>> {
    let dwarf = dwarf(elf)?;
    let mut found = BTreeMap::new();
    let mut headers = dwarf.units();
    while let Some(header) = headers.next()? {
        let unit = dwarf.unit(header)?;
        let unit = unit.unit_ref(&dwarf);
        // The depth of the crate's namespace while the cursor is in it.
        let mut within = None;
        let mut entries = unit.entries();
        while let Some(entry) = entries.next_dfs()? {
            within = within.filter(|depth| entry.depth() > *depth);
            let Some(name) = entry.attr_value(constants::DW_AT_name) else {
                continue;
            };
            let name: Reader<'_> = unit.attr_string(name)?;
            let namespace = within.is_none() && name.slice() == krate.as_bytes();
            match entry.tag() {
                constants::DW_TAG_namespace if namespace => within = Some(entry.depth()),
                constants::DW_TAG_structure_type if within.is_some() => {
                    let size = entry.attr_value(constants::DW_AT_byte_size);
                    let size = size.and_then(|size| size.udata_value()).unwrap_or_default();
                    let name = name.to_string_lossy().into_owned();
                    let largest: &mut u64 = found.entry(name).or_default();
                    *largest = size.max(*largest);
                }
                _ => {}
            }
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crate_is_found_in_the_path_of_a_source() {
        let registry = "/r/.cargo/registry/src/index.crates.io-1949cf8c";
        let hal = format!("{registry}/stm32f1xx-hal-0.11.0/src/rcc.rs");
        for (path, name) in [
            (
                "/me/modio/modbus-server/src/rtu/crc.rs",
                Some("modbus_server"),
            ),
            (hal.as_str(), Some("stm32f1xx_hal")),
            ("C:\\modio\\firmware\\src\\app\\main.rs", Some("firmware")),
            (
                "/m/target/firmware/build/stm32f1-2ab4c6/out/x.rs",
                Some("stm32f1"),
            ),
            ("src/main.rs", None),
        ] {
            assert_eq!(crate_of(path).as_deref(), name, "{path}");
        }
    }
}
