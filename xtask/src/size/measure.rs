//! Counts the bytes of an image: each byte once, for its section and for the crate it is of.

use std::collections::BTreeMap;

use object::elf::{SHF_ALLOC, SHF_EXECINSTR, SHT_NOBITS, STT_FUNC};
use object::read::elf::{SectionHeader, Sym};

use super::owner;
use super::source::Source;
use crate::image::{self, RAM_BASE};

/// Bytes of a section that no symbol covers: constants without a name, and padding.
const UNNAMED: &str = "(unnamed constants, padding)";

/// More than any microcontroller has of a memory, in bytes.
const LARGEST: u32 = 16 * 1024 * 1024;

/// Bytes taken of each memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bytes {
    /// Of flash, initial values of variables included.
    pub flash: u32,
    /// Of RAM, without the stack.
    pub ram: u32,
}

impl std::ops::AddAssign for Bytes {
    fn add_assign(&mut self, other: Self) {
        self.flash += other.flash;
        self.ram += other.ram;
    }
}

/// What an image takes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// By section, in the order of the image.
    pub sections: Vec<(String, Bytes)>,
    /// By crate, those with most flash first.
    pub crates: Vec<(String, Bytes)>,
    /// In all.
    pub total: Bytes,
}

/// Measures an ELF image.
///
/// # Errors
///
/// When it is no ELF image, or a broken one.
pub fn measure(bytes: &[u8]) -> Result<Sizes, String> {
    let broken = |error: object::Error| format!("the image is broken: {error}");
    let elf = image::parse(bytes)?;
    let endian = elf.endian();
    let table = elf.elf_section_table();
    let symbols = elf.elf_symbol_table();

    let source = Source::new(&elf, bytes)?;
    let mut sizes = Sizes::default();
    let mut crates = BTreeMap::<String, Bytes>::new();
    for (index, section) in table.enumerate() {
        let size = section.sh_size(endian);
        let flags = section.sh_flags(endian);
        if flags & SHF_ALLOC == 0 || size == 0 {
            continue;
        }
        let start = section.sh_addr(endian);
        let end = start
            .checked_add(size)
            .filter(|_| size <= LARGEST)
            .ok_or_else(|| format!("the image is broken: a section of {size} bytes"))?;
        let in_file = section.sh_type(endian) != SHT_NOBITS;
        let taken = |size: u32| Bytes {
            flash: if in_file { size } else { 0 },
            ram: if start >= RAM_BASE { size } else { 0 },
        };
        let name = table.section_name(endian, section).map_err(broken)?;
        sizes
            .sections
            .push((String::from_utf8_lossy(name).into_owned(), taken(size)));
        sizes.total += taken(size);

        // Code is its source's; the rest, and code without debug information, its symbol's.
        let mut owned = Vec::new();
        if flags & SHF_EXECINSTR != 0 {
            owned = source.owners(start, end);
        }
        for symbol in symbols.iter() {
            // Bit 0 of a function's address is the Thumb bit.
            let address = match symbol.st_type() {
                STT_FUNC => symbol.st_value(endian) & !1,
                _ => symbol.st_value(endian),
            };
            if usize::from(symbol.st_shndx(endian)) == index.0 {
                let name = symbols.symbol_name(endian, symbol).map_err(broken)?;
                let owner = owner::of(&String::from_utf8_lossy(name));
                owned.push((address, symbol.st_size(endian), owner));
            }
        }
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

/// Shares out `size` bytes from address `start`: each goes to the first owner that claims it, as owners
/// overlap (symbols have aliases), or to nobody.
fn share(start: u32, size: u32, owned: Vec<(u32, u32, String)>) -> BTreeMap<String, u32> {
    let mut free = vec![true; size as usize];
    let mut shares = BTreeMap::new();
    for (address, length, owner) in owned {
        let from = address.saturating_sub(start).min(size);
        let to = from.saturating_add(length).min(size);
        let claimed = &mut free[from as usize..to as usize];
        let bytes = claimed.iter().filter(|free| **free).count() as u32;
        claimed.fill(false);
        *shares.entry(owner).or_default() += bytes;
    }
    let rest = free.iter().filter(|free| **free).count() as u32;
    *shares.entry(UNNAMED.to_owned()).or_default() += rest;
    shares.retain(|_, bytes| *bytes > 0);
    shares
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::FLASH_BASE;
    use crate::image::sample::{self, Segment};

    const FUNCTION: &str = "_ZN13modbus_server3crc5crc1617h0123456789abcdefE";
    const ALIAS: &str = "_ZN13modbus_server3crc5other17h0123456789abcdefE";
    const VARIABLE: &str = "_ZN8firmware5STATE17h0123456789abcdefE";
    const ZEROED: &str = "_ZN8firmware6BUFFER17h0123456789abcdefE";

    fn sizes() -> Sizes {
        let segments = [
            Segment::at(FLASH_BASE, &[0; 100]),
            Segment {
                load: FLASH_BASE + 100,
                run: RAM_BASE,
                data: &[1; 8],
                size: 8,
            },
            Segment {
                load: RAM_BASE + 8,
                run: RAM_BASE + 8,
                data: &[],
                size: 256,
            },
        ];
        let symbols = [
            ("Reset", FLASH_BASE, 10),
            (FUNCTION, FLASH_BASE + 10, 40),
            (ALIAS, FLASH_BASE + 10, 40),
            (VARIABLE, RAM_BASE, 8),
            (ZEROED, RAM_BASE + 8, 200),
        ];
        measure(&sample::elf(&segments, &symbols)).unwrap()
    }

    fn of(sizes: &[(String, Bytes)], name: &str) -> (u32, u32) {
        let found = sizes.iter().find(|(entry, _)| entry == name);
        found
            .map(|(_, taken)| (taken.flash, taken.ram))
            .unwrap_or_else(|| panic!("no {name}"))
    }

    #[test]
    fn sections_take_flash_ram_or_both() {
        let sizes = sizes();
        assert_eq!(of(&sizes.sections, ".text"), (100, 0));
        assert_eq!(of(&sizes.sections, ".data"), (8, 8));
        assert_eq!(of(&sizes.sections, ".bss"), (0, 256));
        assert_eq!(
            sizes.total,
            Bytes {
                flash: 108,
                ram: 264
            }
        );
    }

    #[test]
    fn crates_share_every_byte_once() {
        let sizes = sizes();
        assert_eq!(
            of(&sizes.crates, "modbus_server"),
            (40, 0),
            "an alias counts once"
        );
        assert_eq!(of(&sizes.crates, "firmware"), (8, 208));
        assert_eq!(of(&sizes.crates, owner::NAMED), (10, 0));
        assert_eq!(of(&sizes.crates, UNNAMED), (50, 56));
        let mut sum = Bytes::default();
        sizes.crates.iter().for_each(|(_, taken)| sum += *taken);
        assert_eq!(sum, sizes.total);
    }

    #[test]
    fn code_is_shared_out_once_and_what_nobody_claims_is_left() {
        let owned = [(8, 8, "a"), (12, 8, "b"), (0, 4, "c"), (30, 90, "d")];
        let owned = owned.map(|(at, length, name)| (at, length, name.to_owned()));
        let shares = share(8, 24, owned.to_vec());
        let expected = [("a", 8), ("b", 4), ("d", 2), (UNNAMED, 10)];
        let expected = expected.map(|(name, bytes)| (name.to_owned(), bytes));
        assert_eq!(shares, BTreeMap::from(expected));
    }

    #[test]
    fn a_section_larger_than_any_memory_is_refused() {
        let run = RAM_BASE;
        let bss = Segment {
            load: run,
            run,
            data: &[],
            size: LARGEST + 1,
        };
        assert!(measure(&sample::elf(&[bss], &[])).is_err());
    }

    #[test]
    fn a_file_that_is_no_image_is_refused() {
        assert!(measure(b"\x7fELF").is_err());
    }
}
