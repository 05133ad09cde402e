//! Small images for tests.

use object::build::elf::{Builder, SectionData};
use object::{Endianness, elf};

/// A load segment, which is a section at the same time: load address, run address, data, size in memory.
pub type Segment<'a> = (u32, u32, &'a [u8], u32);

/// A function or variable: name, address, size. The address of a function has the Thumb bit.
pub type Symbol<'a> = (&'a str, u32, u32);

/// Returns code or constants that are used at their load address.
pub fn code(address: u32, data: &[u8]) -> Segment<'_> {
    (address, address, data, data.len() as u32)
}

/// Returns an ELF file with these contents, and with a section of debug information.
pub fn elf(segments: &[Segment], symbols: &[Symbol]) -> Vec<u8> {
    let mut file = Builder::new(Endianness::Little, false);
    file.header.e_machine = elf::EM_ARM;
    file.header.e_phoff = file.file_header_size() as u64;
    let mut offset = file.header.e_phoff + 32 * segments.len() as u64;
    for &(load, run, data, size) in segments {
        let section = file.sections.add();
        let (name, kind, flags) = match (data.is_empty(), load == run) {
            (true, _) => (".bss", elf::SHT_NOBITS, 0),
            (false, true) => (".text", elf::SHT_PROGBITS, elf::SHF_EXECINSTR),
            (false, false) => (".data", elf::SHT_PROGBITS, 0),
        };
        (section.name, section.sh_type) = (name.into(), kind);
        (section.sh_flags, section.sh_addralign) = ((elf::SHF_ALLOC | flags).into(), 1);
        (section.sh_addr, section.sh_offset) = (run.into(), offset);
        section.sh_size = size.into();
        section.data = match kind {
            elf::SHT_NOBITS => SectionData::UninitializedData(size.into()),
            _ => SectionData::Data(data.into()),
        };
        let segment = file.segments.add();
        segment.p_type = elf::PT_LOAD;
        segment.append_section_range(section);
        segment.sections.push(section.id());
        (segment.p_paddr, segment.p_filesz) = (load.into(), data.len() as u64);
        offset += data.len() as u64;
    }
    for (name, data) in [
        (".debug_str", SectionData::Data(vec![7; 50].into())),
        (".symtab", SectionData::Symbol),
        (".strtab", SectionData::String),
        (".shstrtab", SectionData::SectionString),
    ] {
        let section = file.sections.add();
        (section.name, section.data) = (name.into(), data);
        (section.sh_type, section.sh_addralign) = (elf::SHT_PROGBITS, 1);
    }
    for &(name, address, size) in symbols {
        let symbol = file.symbols.add();
        let kind = [elf::STT_OBJECT, elf::STT_FUNC][address as usize & 1];
        symbol.set_st_info(elf::STB_GLOBAL, kind);
        (symbol.name, symbol.st_shndx) = (name.into(), elf::SHN_ABS);
        (symbol.st_value, symbol.st_size) = (address.into(), size.into());
    }
    file.set_section_sizes();
    let mut bytes = Vec::new();
    file.write(&mut bytes).unwrap();
    bytes
}
