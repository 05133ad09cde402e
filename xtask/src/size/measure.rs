//! Counts the bytes of an image: each byte once, for its section and for its crate.

use std::collections::BTreeMap;

use anyhow::{Context as _, Result};
use object::elf::{SHF_ALLOC, SHF_EXECINSTR, SHT_NOBITS};
use object::read::elf::SectionHeader as _;
use object::{Object as _, ObjectSection as _};

use super::source::Source;
use crate::image::{self, RAM_BASE};

/// Bytes of a section that no symbol covers: constants without a name, and padding.
const UNNAMED: &str = "(unnamed constants, padding)";

/// Start-up code, exception vectors and interrupt handlers: symbols whose names are no Rust paths.
const NAMED: &str = "(vectors, handlers, start-up)";

/// Bytes of flash, including initial values of variables, and bytes of RAM, without the stack.
pub type Bytes = [u32; 2];

/// The sizes of an image.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Sizes by section, in the order of the image.
    pub sections: Vec<(String, Bytes)>,
    /// Sizes by crate, those with most flash first.
    pub crates: Vec<(String, Bytes)>,
}

impl Sizes {
    /// Returns the sizes of the whole image.
    pub fn total(&self) -> Bytes {
        [0, 1].map(|memory| self.sections.iter().map(|row| row.1[memory]).sum())
    }
}

/// Measures an ELF image.
pub fn measure(bytes: &[u8]) -> Result<Sizes> {
    let elf = image::parse(bytes)?;
    let endian = elf.endian();
    let source = Source::new(&elf)?;
    let symbols = image::symbols(&elf)?;
    let mut sections = Vec::new();
    let mut crates = BTreeMap::<String, Bytes>::new();
    for section in elf.sections() {
        let header = section.elf_section_header();
        let flags = header.sh_flags(endian);
        let (start, size) = (header.sh_addr(endian), header.sh_size(endian));
        if flags & SHF_ALLOC == 0 || size == 0 {
            continue;
        }
        let end = start.saturating_add(size);
        let in_file = u32::from(header.sh_type(endian) != SHT_NOBITS);
        let in_ram = u32::from(start >= RAM_BASE);
        let taken = |size: u32| [in_file * size, in_ram * size];
        let name = section.name().context("the image is broken")?;
        sections.push((name.to_owned(), taken(size)));

        // Code belongs to the crate of its source. The rest, and code without debug information, belongs to the crate
        // of its symbol.
        let mut owned = Vec::new();
        if flags & SHF_EXECINSTR != 0 {
            owned = source.owners(start, end);
        }
        let here = |symbol: &&image::Symbol| (start..end).contains(&symbol.address);
        let here = symbols.iter().filter(here);
        owned.extend(here.map(|symbol| (symbol.address, symbol.size, owner(&symbol.name))));
        for (owner, bytes) in share(start, size, owned) {
            let sum = crates.entry(owner).or_default();
            *sum = [sum[0] + taken(bytes)[0], sum[1] + taken(bytes)[1]];
        }
    }
    let mut crates: Vec<_> = crates.into_iter().collect();
    crates.sort_by_key(|(_, taken)| std::cmp::Reverse(*taken));
    Ok(Sizes { sections, crates })
}

/// Distributes `size` bytes from address `start`. Owners overlap because symbols have aliases: each byte belongs to the
/// first owner that claims it, or to none.
fn share(start: u32, size: u32, owned: Vec<(u32, u32, String)>) -> BTreeMap<String, u32> {
    let mut free = vec![true; size as usize];
    let mut shares = BTreeMap::new();
    let everything = (start, size, UNNAMED.to_owned());
    for (address, length, owner) in owned.into_iter().chain([everything]) {
        let from = address.saturating_sub(start).min(size);
        let to = from.saturating_add(length).min(size);
        let claimed = &mut free[from as usize..to as usize];
        let bytes = claimed.iter().filter(|free| **free).count() as u32;
        claimed.fill(false);
        *shares.entry(owner).or_default() += bytes;
    }
    shares.retain(|_, bytes| *bytes > 0);
    shares
}

/// Returns the crate of a symbol, from its name: the first crate in the path. For `<type as trait>` it is that of the
/// type, or where the type has no crate (`&str`, `u32`, `[T]`) that of the trait.
fn owner(symbol: &str) -> String {
    // Without the hash, or the crate's disambiguator.
    let path = format!("{:#}", rustc_demangle::demangle(symbol));
    let outside = |c: char| !c.is_alphanumeric() && c != '_';
    let first = path.split_once("::").map(|(first, _)| first);
    let name = first.and_then(|first| first.rsplit(outside).next());
    let name = name.filter(|name| !name.is_empty());
    name.unwrap_or(NAMED).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::FLASH_BASE;
    use crate::image::sample::{code, elf};

    const FUNCTION: &str = "_ZN13modbus_server3crc5crc1617h0123456789abcdefE";
    const ALIAS: &str = "_ZN13modbus_server3crc5other17h0123456789abcdefE";
    const VARIABLE: &str = "_ZN8firmware5STATE17h0123456789abcdefE";
    const ZEROED: &str = "_ZN8firmware6BUFFER17h0123456789abcdefE";

    #[test]
    fn every_byte_is_counted_once_for_its_section_and_its_crate() {
        let segments = [
            code(FLASH_BASE, &[0; 100]),
            (FLASH_BASE + 100, RAM_BASE, &[1; 8], 8),
            (RAM_BASE + 8, RAM_BASE + 8, &[], 256),
        ];
        let symbols = [
            ("Reset", FLASH_BASE, 10),
            (FUNCTION, FLASH_BASE + 10, 40),
            (ALIAS, FLASH_BASE + 10, 50),
            (VARIABLE, RAM_BASE, 8),
            (ZEROED, RAM_BASE + 8, 200),
        ];
        let sizes = measure(&elf(&segments, &symbols)).unwrap();
        let named = |(name, flash, ram): (&str, u32, u32)| (name.to_owned(), [flash, ram]);
        let sections = [(".text", 100, 0), (".data", 8, 8), (".bss", 0, 256)];
        assert_eq!(sizes.sections, sections.map(named));
        let crates = [
            ("modbus_server", 50, 0),
            (UNNAMED, 40, 56),
            (NAMED, 10, 0),
            ("firmware", 8, 208),
        ];
        assert_eq!(sizes.crates, crates.map(named));
        assert_eq!(sizes.total(), [108, 264]);
    }

    #[test]
    fn owner_is_the_first_crate_in_the_name() {
        for (symbol, name) in [
            (FUNCTION, "modbus_server"),
            ("_RNvCskwGfYPst2Cb_3foo16example_function", "foo"),
            (
                "_ZN50_$LT$firmware..App$u20$as$u20$core..fmt..Debug$GT$3fmt17h0123456789abcdefE",
                "firmware",
            ),
            (
                "_ZN40_$LT$u32$u20$as$u20$core..fmt..Debug$GT$3fmt17h0123456789abcdefE",
                "core",
            ),
            ("USART1", NAMED),
        ] {
            assert_eq!(owner(symbol), name);
        }
    }
}
