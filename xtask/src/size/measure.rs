//! Counts the bytes of an image: each byte once, for its section and for its crate.

use std::collections::BTreeMap;

use anyhow::{Context as _, Result};
use object::elf::{SHF_ALLOC, SHF_EXECINSTR, SHT_NOBITS};
use object::read::elf::SectionHeader as _;
use object::{Object as _, ObjectSection as _};

use super::owner;
use super::source::Source;
use crate::image::{self, RAM_BASE};

/// Bytes of a section that no symbol covers: constants without a name, and padding.
const UNNAMED: &str = "(unnamed constants, padding)";

/// More bytes than any microcontroller has of a memory.
const LARGEST: u32 = 16 * 1024 * 1024;

/// Bytes of each memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bytes {
    /// Bytes of flash, including initial values of variables.
    pub flash: u32,
    /// Bytes of RAM, without the stack.
    pub ram: u32,
}

impl std::ops::AddAssign for Bytes {
    fn add_assign(&mut self, other: Self) {
        self.flash += other.flash;
        self.ram += other.ram;
    }
}

/// The sizes of an image.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Sizes by section, in the order of the image.
    pub sections: Vec<(String, Bytes)>,
    /// Sizes by crate, those with most flash first.
    pub crates: Vec<(String, Bytes)>,
    /// Sizes of the whole image.
    pub total: Bytes,
}

/// Measures an ELF image.
pub fn measure(bytes: &[u8]) -> Result<Sizes> {
    let elf = image::parse(bytes)?;
    let endian = elf.endian();
    let source = Source::new(&elf)?;
    let symbols = image::symbols(&elf)?;
    let mut sizes = Sizes::default();
    let mut crates = BTreeMap::<String, Bytes>::new();
    for section in elf.sections() {
        let header = section.elf_section_header();
        let flags = header.sh_flags(endian);
        let (start, size) = (header.sh_addr(endian), header.sh_size(endian));
        if flags & SHF_ALLOC == 0 || size == 0 {
            continue;
        }
        let end = start
            .checked_add(size)
            .filter(|_| size <= LARGEST)
            .with_context(|| format!("the image is broken: a section of {size} bytes"))?;
        let in_file = header.sh_type(endian) != SHT_NOBITS;
        let taken = |size: u32| Bytes {
            flash: if in_file { size } else { 0 },
            ram: if start >= RAM_BASE { size } else { 0 },
        };
        let name = section.name().context("the image is broken")?;
        sizes.sections.push((name.to_owned(), taken(size)));
        sizes.total += taken(size);

        // Code belongs to the crate of its source. The rest, and code without debug information, belongs to the crate
        // of its symbol.
        let mut owned = Vec::new();
        if flags & SHF_EXECINSTR != 0 {
            owned = source.owners(start, end);
        }
        let here = symbols
            .iter()
            .filter(|symbol| (start..end).contains(&symbol.address));
        owned.extend(here.map(|symbol| (symbol.address, symbol.size, owner::of(&symbol.name))));
        for (owner, bytes) in share(start, size, owned) {
            *crates.entry(owner).or_default() += taken(bytes);
        }
    }
    sizes.crates = crates.into_iter().collect();
    sizes
        .crates
        .sort_by_key(|(_, taken)| std::cmp::Reverse((taken.flash, taken.ram)));
    Ok(sizes)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::FLASH_BASE;
    use crate::image::sample::{code, elf};

    const FUNCTION: &str = "_ZN13modbus_server3crc5crc1617h0123456789abcdefE";
    const ALIAS: &str = "_ZN13modbus_server3crc5other17h0123456789abcdefE";
    const VARIABLE: &str = "_ZN8firmware5STATE17h0123456789abcdefE";
    const ZEROED: &str = "_ZN8firmware6BUFFER17h0123456789abcdefE";

    fn bytes(flash: u32, ram: u32) -> Bytes {
        Bytes { flash, ram }
    }

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
            (ALIAS, FLASH_BASE + 10, 40),
            (VARIABLE, RAM_BASE, 8),
            (ZEROED, RAM_BASE + 8, 200),
        ];
        let sizes = measure(&elf(&segments, &symbols)).unwrap();
        let named = |name: &str, flash, ram| (name.to_owned(), bytes(flash, ram));
        assert_eq!(
            sizes.sections,
            [
                named(".text", 100, 0),
                named(".data", 8, 8),
                named(".bss", 0, 256)
            ]
        );
        assert_eq!(
            sizes.crates,
            [
                named(UNNAMED, 50, 56),
                named("modbus_server", 40, 0),
                named(owner::NAMED, 10, 0),
                named("firmware", 8, 208),
            ]
        );
        assert_eq!(sizes.total, bytes(108, 264));
    }

    #[test]
    fn overlapping_claims_belong_to_the_first_owner() {
        let owned = [(8, 8, "a"), (12, 8, "b"), (0, 4, "c"), (30, 90, "d")];
        let owned = owned.map(|(at, length, name)| (at, length, name.to_owned()));
        let shares = share(8, 24, owned.to_vec());
        let expected = [("a", 8), ("b", 4), ("d", 2), (UNNAMED, 10)];
        assert_eq!(
            shares,
            BTreeMap::from(expected.map(|(name, bytes)| (name.to_owned(), bytes)))
        );
    }

    #[test]
    fn damaged_image_is_refused() {
        let bss = (RAM_BASE, RAM_BASE, &[][..], LARGEST + 1);
        assert!(measure(&elf(&[bss], &[])).is_err());
        assert!(measure(b"\x7fELF").is_err());
    }
}
