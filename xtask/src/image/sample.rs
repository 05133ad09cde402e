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

/// Returns an ELF file for an Arm core with these contents.
pub fn elf(segments: &[Segment], symbols: &[Symbol]) -> Vec<u8> {
    let mut builder = Builder::new(Endianness::Little, false);
    builder.header.e_type = elf::ET_EXEC;
    builder.header.e_machine = elf::EM_ARM;
    builder.header.e_phoff = 0x34;
    let mut sections = Vec::new();
    for &(load, run, data, size) in segments {
        let section = builder.sections.add();
        section.name = match (data.is_empty(), load == run) {
            (true, _) => b".bss"[..].into(),
            (false, true) => b".text"[..].into(),
            (false, false) => b".data"[..].into(),
        };
        section.sh_flags = elf::SHF_ALLOC.into();
        section.sh_addr = run.into();
        section.sh_addralign = 1;
        section.sh_size = size.into();
        if data.is_empty() {
            section.sh_type = elf::SHT_NOBITS;
            section.data = SectionData::UninitializedData(size.into());
        } else {
            section.sh_type = elf::SHT_PROGBITS;
            section.data = SectionData::Data(data.into());
        }
        sections.push((section.id(), run..run.saturating_add(size)));
    }
    for &(name, address, size) in symbols {
        let home = sections.iter().find(|(_, range)| range.contains(&address));
        let symbol = builder.symbols.add();
        symbol.name = name.as_bytes().into();
        symbol.section = Some(home.expect("a symbol in a segment").0);
        symbol.set_st_info(
            elf::STB_GLOBAL,
            if address & 1 == 1 {
                elf::STT_FUNC
            } else {
                elf::STT_OBJECT
            },
        );
        symbol.st_value = address.into();
        symbol.st_size = size.into();
    }
    for (name, kind) in [
        (".symtab", SectionData::Symbol),
        (".strtab", SectionData::String),
        (".shstrtab", SectionData::SectionString),
    ] {
        let section = builder.sections.add();
        section.name = name.as_bytes().into();
        section.sh_type = if name == ".symtab" {
            elf::SHT_SYMTAB
        } else {
            elf::SHT_STRTAB
        };
        section.sh_addralign = 1;
        section.data = kind;
    }
    for _ in segments {
        builder.segments.add().p_type = elf::PT_LOAD;
    }
    builder.set_section_sizes();
    // After the file header and the program headers.
    let mut offset = 0x34 + 0x20 * segments.len() as u64;
    for ((section, _), &(_, _, data, _)) in sections.iter().zip(segments) {
        builder.sections.get_mut(*section).sh_offset = offset;
        offset += data.len() as u64;
    }
    for (segment, &(load, run, data, size)) in builder.segments.iter_mut().zip(segments) {
        segment.p_paddr = load.into();
        segment.p_vaddr = run.into();
        segment.p_filesz = data.len() as u64;
        segment.p_memsz = size.into();
        segment.p_align = 1;
    }
    for ((section, _), segment) in sections.iter().zip(&mut builder.segments) {
        segment.p_offset = builder.sections.get(*section).sh_offset;
        segment.sections.push(*section);
    }
    let mut bytes = Vec::new();
    builder.write(&mut bytes).unwrap();
    bytes
}
