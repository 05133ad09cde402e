//! A firmware image: what an ELF file puts into flash, and the names of its symbols.

use std::collections::BTreeMap;
use std::path::Path;

use object::{Object, ObjectSegment, ObjectSymbol};

use crate::error::Error;
use crate::memory::FLASH_BASE;

/// Bytes of flash of the largest part of the family (RM0008 3.3.3).
const LARGEST_FLASH: usize = 1024 * 1024;

/// A firmware image, ready to be written into flash.
#[derive(Clone, Debug)]
pub struct Image {
    /// Where each run of bytes goes (offset into flash), and the bytes.
    segments: Vec<(usize, Vec<u8>)>,
    pub(crate) symbols: BTreeMap<String, u32>,
    entry: u32,
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
        for segment in elf.segments() {
            let (_, length) = segment.file_range();
            let header = segment.elf_program_header();
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
        Ok(Self {
            segments,
            symbols,
            entry: elf.entry() as u32,
        })
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
        Ok(Self {
            segments: vec![(offset, code.to_vec())],
            symbols: BTreeMap::new(),
            entry: reset,
        })
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
