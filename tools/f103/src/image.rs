//! A firmware image: what an ELF file puts into flash, and the names of its symbols.

use std::collections::BTreeMap;
use std::path::Path;

use object::{Object, ObjectSegment, ObjectSymbol};

use crate::error::Error;
use crate::memory::{FLASH_BASE, RAM_BASE};
use crate::part::Part;

/// Bytes of flash of the largest part of the family (RM0008 3.3.3).
const LARGEST_FLASH: usize = 1024 * 1024;
/// Bytes from the start of the SRAM to its bit-band alias (PM0056 2.2): an address beyond is none of SRAM.
const RAM_REGION: usize = 0x0200_0000;

/// A firmware image, ready to be written into flash.
#[derive(Clone, Debug)]
pub struct Image {
    /// Where each run of bytes goes (offset into flash), and the bytes.
    segments: Vec<(usize, Vec<u8>)>,
    pub(crate) symbols: BTreeMap<String, u32>,
    entry: u32,
    /// Bytes of SRAM that it uses, from the first on, as far as the image says.
    ram: usize,
}

impl Image {
    /// Reads an ELF file for 32-bit ARM.
    ///
    /// # Errors
    ///
    /// [`Error::Image`] when the file cannot be read, is no such ELF, or loads something outside flash.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let bytes = std::fs::read(path)
            .map_err(|error| Error::Image(format!("{}: {error}", path.display())))?;
        Self::from_elf(&bytes).map_err(|error| match error {
            Error::Image(text) => Error::Image(format!("{}: {text}", path.display())),
            other => other,
        })
    }

    /// Takes the contents of an ELF file for 32-bit ARM.
    ///
    /// A segment goes to its physical address (`p_paddr`), where the start-up code copies it from.
    ///
    /// # Errors
    ///
    /// [`Error::Image`] when it is no such ELF, or loads something outside flash.
    pub fn from_elf(bytes: &[u8]) -> Result<Self, Error> {
        let bad = |text: &str| Error::Image(text.to_owned());
        let elf = object::read::elf::ElfFile32::<object::Endianness>::parse(bytes)
            .map_err(|error| Error::Image(format!("not a 32-bit ELF file: {error}")))?;
        if elf.architecture() != object::Architecture::Arm || !elf.is_little_endian() {
            return Err(bad("not an image for a little-endian ARM core"));
        }
        let mut segments = Vec::new();
        let mut ram = 0;
        for segment in elf.segments() {
            let (_, length) = segment.file_range();
            let header = segment.elf_program_header();
            let [start, size] =
                [&header.p_vaddr, &header.p_memsz].map(|word| word.get(elf.endian()));
            ram = ram.max(ram_up_to(u64::from(start) + u64::from(size)));
            if length == 0 {
                continue;
            }
            let data = segment
                .data()
                .map_err(|error| Error::Image(format!("cut short: {error}")))?;
            let address = header.p_paddr.get(elf.endian());
            segments.push((flash_offset(address, data.len())?, data.to_vec()));
        }
        if segments.is_empty() {
            return Err(bad("nothing in it to load"));
        }
        let symbols = elf
            .symbols()
            .filter_map(|symbol| Some((symbol.name().ok()?.to_owned(), symbol.address() as u32)))
            .filter(|(name, _)| !name.is_empty())
            .collect();
        let mut image = Self {
            segments,
            symbols,
            entry: elf.entry() as u32,
            ram,
        };
        image.ram = ram.max(image.stack());
        Ok(image)
    }

    /// Takes plain machine code, which goes to the start of flash: its vector table first. It has no symbols.
    ///
    /// # Errors
    ///
    /// [`Error::Image`] when it is empty or does not fit.
    pub fn from_bytes(code: &[u8]) -> Result<Self, Error> {
        if code.len() < 8 {
            return Err(Error::Image("no vector table in it".to_owned()));
        }
        let offset = flash_offset(FLASH_BASE, code.len())?;
        let reset = u32::from_le_bytes([code[4], code[5], code[6], code[7]]);
        let mut image = Self {
            segments: vec![(offset, code.to_vec())],
            symbols: BTreeMap::new(),
            entry: reset,
            ram: 0,
        };
        image.ram = image.stack();
        Ok(image)
    }

    /// Returns the bytes of SRAM up to where the stack begins: the first word of the vector table at the start of the
    /// image.
    fn stack(&self) -> usize {
        let first = self.segments.iter().min_by_key(|(offset, _)| *offset);
        let word = first.and_then(|(_, data)| data.first_chunk());
        word.map_or(0, |word| ram_up_to(u64::from(u32::from_le_bytes(*word))))
    }

    /// Returns how many bytes of SRAM it uses, from the first on, as far as it says: its variables and its first stack.
    #[must_use]
    pub fn ram(&self) -> usize {
        self.ram
    }

    /// Checks that `part` has the memories that the image uses.
    ///
    /// # Errors
    ///
    /// [`Error::Image`] when it does not, with the part that would do.
    pub fn check(&self, part: &Part) -> Result<(), Error> {
        let ends = self
            .segments
            .iter()
            .map(|(offset, data)| offset + data.len());
        let flash = ends.max().unwrap_or(0);
        part.check_memories(flash, self.ram).map_err(Error::Image)
    }

    /// Returns where it starts, as the ELF header says (bit 0 set: Thumb).
    #[must_use]
    pub fn entry(&self) -> u32 {
        self.entry
    }

    /// Returns the address of a symbol; a function's has bit 0 set (Thumb).
    #[must_use]
    pub fn symbol(&self, name: &str) -> Option<u32> {
        self.symbols.get(name).copied()
    }

    /// Returns how many bytes of flash it fills.
    #[must_use]
    pub fn size(&self) -> usize {
        self.segments.iter().map(|(_, data)| data.len()).sum()
    }

    /// Writes it into `flash` with pages of `page` bytes, as a programmer on the SWD pins would: the pages it
    /// needs are erased first, the others keep what they hold.
    ///
    /// # Errors
    ///
    /// [`Error::Image`] when it does not fit.
    pub fn load(&self, flash: &mut [u8], page: usize) -> Result<(), Error> {
        for (offset, data) in &self.segments {
            if offset + data.len() > flash.len() {
                return Err(does_not_fit(FLASH_BASE + *offset as u32, data.len()));
            }
            let first = offset / page * page;
            let end = (offset + data.len()).next_multiple_of(page);
            flash[first..end].fill(0xFF);
        }
        for (offset, data) in &self.segments {
            flash[*offset..*offset + data.len()].copy_from_slice(data);
        }
        Ok(())
    }
}

/// Returns the bytes of SRAM before `address`; 0 if no part of the family has SRAM there.
fn ram_up_to(address: u64) -> usize {
    let offset = address.wrapping_sub(u64::from(RAM_BASE)) as usize;
    if offset <= RAM_REGION { offset } else { 0 }
}

/// Returns the offset into flash of `length` bytes at `address`.
fn flash_offset(address: u32, length: usize) -> Result<usize, Error> {
    let offset = address.wrapping_sub(FLASH_BASE) as usize;
    if offset < LARGEST_FLASH && length <= LARGEST_FLASH - offset {
        Ok(offset)
    } else {
        Err(does_not_fit(address, length))
    }
}

fn does_not_fit(address: u32, length: usize) -> Error {
    Error::Image(format!(
        "{length} bytes at {address:#010x} do not fit the flash"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chip::{Chip, Config};
    use crate::part::{STM32F103CB, STM32F103RC};

    /// Returns an ELF file with a vector table at the start of flash, whose first word is `stack`, and with variables
    /// without initial values from `start` on.
    fn elf(stack: u32, start: u32, size: u32) -> Vec<u8> {
        const HEADERS: u32 = 52;
        const VECTORS: u32 = HEADERS + 2 * 32;
        let mut file = b"\x7FELF\x01\x01\x01\0\0\0\0\0\0\0\0\0".to_vec();
        // An executable (2) for ARM (40); one header has 52 bytes, the other two have 32 each.
        for word in [
            40 << 16 | 2,
            1,
            FLASH_BASE + 9,
            HEADERS,
            0,
            0,
            32 << 16 | 52,
            2,
            0,
        ] {
            file.extend(word.to_le_bytes());
        }
        // Loaded (1): place in the file, both addresses, bytes in the file and in memory, flags, alignment.
        for header in [
            [1, VECTORS, FLASH_BASE, FLASH_BASE, 12, 12, 5, 4],
            [1, VECTORS, start, start, 0, size, 6, 4],
        ] {
            file.extend(header.iter().flat_map(|word: &u32| word.to_le_bytes()));
        }
        for word in [stack, FLASH_BASE + 9, 0xE7FE_E7FE] {
            file.extend(word.to_le_bytes());
        }
        file
    }

    #[test]
    fn sram_that_an_image_uses_is_that_of_its_variables_and_of_its_stack() {
        let ram = |stack, start, size| Image::from_elf(&elf(stack, start, size)).unwrap().ram();
        assert_eq!(ram(0x2000_5000, 0x2000_0000, 100), 0x5000);
        assert_eq!(ram(0x2000_0400, 0x2000_4000, 0x1004), 0x5004);
        assert_eq!(ram(0, 0x2000_0000, 0), 0);
        // Neither address is in the SRAM region.
        assert_eq!(ram(0xFFFF_FFFF, 0x1000_0000, 0x1_0000), 0);
    }

    #[test]
    fn image_that_needs_more_sram_than_the_part_has_is_refused_with_a_part_that_would_do() {
        for (stack, start, size) in [
            (0x2000_C000, 0x2000_0000, 4),
            (0x2000_5000, 0x2000_0000, 0x5004),
        ] {
            let image = Image::from_elf(&elf(stack, start, size)).unwrap();
            let made = |part| {
                let config = Config {
                    part,
                    ..Config::default()
                };
                Chip::in_circuit(&image, config, ()).map(|_| ())
            };
            assert_eq!(made(&STM32F103RC), Ok(()));
            let Err(Error::Image(text)) = made(&STM32F103CB) else {
                panic!("it does not fit");
            };
            assert!(text.contains("KiB of SRAM, but the STM32F103CB"), "{text}");
            assert!(text.contains("an STM32F103xC"), "{text}");
        }
    }
}
