//! Whose an instruction is: the crate whose source the debug information says it comes from.
//!
//! Symbols alone do not tell, for much of an optimised image is inlined into a few interrupt handlers.
//! Code of `core` that is inlined counts for the crate that uses it.

use addr2line::gimli::{self, Dwarf, EndianSlice, LittleEndian};
use object::read::elf::SectionHeader;

use crate::image::Elf;

/// The library that everything uses: what it is used for says more.
const CORE: &str = "core";

/// What debug information is read with.
pub type Reader<'data> = EndianSlice<'data, LittleEndian>;

/// The debug information of an image; none has none.
///
/// # Errors
///
/// When it is broken.
pub fn dwarf<'data>(elf: &Elf<'data>, bytes: &'data [u8]) -> gimli::Result<Dwarf<Reader<'data>>> {
    let endian = elf.endian();
    let table = elf.elf_section_table();
    Dwarf::load(|id| {
        let section = table.section_by_name(endian, id.name().as_bytes());
        let data = section.and_then(|(_, section)| section.data(endian, bytes).ok());
        Ok(EndianSlice::new(data.unwrap_or_default(), LittleEndian))
    })
}

/// Whose an image's code is.
pub struct Source<'data> {
    context: addr2line::Context<Reader<'data>>,
}

impl<'data> Source<'data> {
    /// Takes the debug information of an image; one without has no lines.
    ///
    /// # Errors
    ///
    /// When it is broken.
    pub fn new(elf: &Elf<'data>, bytes: &'data [u8]) -> Result<Self, String> {
        let context = dwarf(elf, bytes).and_then(addr2line::Context::from_dwarf);
        let context = context.map_err(|error| format!("broken debug information: {error}"))?;
        Ok(Self { context })
    }

    /// The stretches of code from `start` up to `end` that come from a known crate: address, bytes, crate.
    pub fn owners(&self, start: u32, end: u32) -> Vec<(u32, u32, String)> {
        let Ok(lines) = self.context.find_location_range(start.into(), end.into()) else {
            return Vec::new();
        };
        lines
            .filter_map(|(address, length, _)| {
                let address = u32::try_from(address).ok()?;
                let owner = self.owner(address)?;
                Some((address, u32::try_from(length).ok()?, owner))
            })
            .collect()
    }

    /// What `of` makes of the innermost source file it knows of the instruction at `address`.
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

    /// The innermost crate but `core` that the instruction at `address` is of.
    fn owner(&self, address: u32) -> Option<String> {
        self.innermost(address, |file| crate_of(file).filter(|name| name != CORE))
            .or_else(|| self.innermost(address, crate_of))
    }
}

/// The crate that a source file is of, by its path: the directory above `src`, without a version; or for
/// generated code the package whose build script made it.
fn crate_of(path: &str) -> Option<String> {
    let parts: Vec<&str> = path.split(['/', '\\']).collect();
    let above = |name: &str| {
        let at = parts.iter().rposition(|part| *part == name)?;
        parts.get(at.checked_sub(1)?).copied()
    };
    // `serde-1.0.2`, or `serde-0a1b...` of target/.../build: a name, `-`, and something with a digit.
    let bare = |name: &str| match name.rsplit_once('-') {
        Some((bare, tail)) if tail.contains(|c: char| c.is_ascii_digit()) => bare.to_owned(),
        _ => name.to_owned(),
    };
    let name = above("src").or_else(|| above("out"))?;
    Some(bare(name).replace('-', "_"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crates_are_known_by_where_their_sources_are() {
        for (path, name) in [
            (
                "/home/me/modio/modbus-server/src/rtu/crc.rs",
                "modbus_server",
            ),
            (
                "/r/.cargo/registry/src/index.crates.io-1949cf8c/stm32f1xx-hal-0.11.0/src/rcc.rs",
                "stm32f1xx_hal",
            ),
            (
                "/r/.cargo/registry/src/index.crates.io-1949cf8c/vcell-0.1.3/src/lib.rs",
                "vcell",
            ),
            (
                "/usr/src/rustc-1.96.0/library/core/src/slice/mod.rs",
                "core",
            ),
            ("/rustc/5980761/library/core/src/num/mod.rs", "core"),
            ("C:\\modio\\firmware\\src\\app\\main.rs", "firmware"),
            (
                "/m/target/thumbv7m-none-eabi/firmware/build/stm32f1-2ab4c6/out/x.rs",
                "stm32f1",
            ),
        ] {
            assert_eq!(crate_of(path).as_deref(), Some(name), "{path}");
        }
        assert_eq!(crate_of("<unknown>"), None);
        assert_eq!(crate_of("src/main.rs"), None);
    }
}
