//! Small images for tests, made with the writing half of crate `object`.

use object::write::elf::{FileHeader, ProgramHeader, SectionHeader, Sym, Writer};
use object::{Endianness, elf};

/// A load segment, which is a section at the same time.
pub(crate) struct Segment<'a> {
    pub(crate) load: u32,
    pub(crate) run: u32,
    pub(crate) data: &'a [u8],
    /// Bytes in memory, at least as many as there are data.
    pub(crate) size: u32,
}

impl<'a> Segment<'a> {
    /// Code or constants, used where they are loaded.
    pub(crate) fn at(address: u32, data: &'a [u8]) -> Self {
        let size = u32::try_from(data.len()).unwrap();
        Self {
            load: address,
            run: address,
            data,
            size,
        }
    }

    fn name(&self) -> &'static [u8] {
        match (self.data.is_empty(), self.load == self.run) {
            (true, _) => b".bss",
            (false, true) => b".text",
            (false, false) => b".data",
        }
    }
}

/// A function or variable: name, address, size.
pub(crate) type Symbol<'a> = (&'a str, u32, u32);

/// An ELF file for an Arm core with these contents.
pub(crate) fn elf(segments: &[Segment], symbols: &[Symbol]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = Writer::new(Endianness::Little, false, &mut bytes);

    writer.reserve_file_header();
    writer.reserve_program_headers(u32::try_from(segments.len()).unwrap());
    let offsets: Vec<usize> = segments
        .iter()
        .map(|segment| writer.reserve(segment.data.len(), 4))
        .collect();
    writer.reserve_null_section_index();
    let sections: Vec<_> = segments
        .iter()
        .map(|segment| {
            (
                writer.add_section_name(segment.name()),
                writer.reserve_section_index(),
            )
        })
        .collect();
    let names: Vec<_> = symbols
        .iter()
        .map(|symbol| writer.add_string(symbol.0.as_bytes()))
        .collect();
    writer.reserve_null_symbol_index();
    symbols.iter().for_each(|_| {
        writer.reserve_symbol_index(None);
    });
    writer.reserve_symtab_section_index();
    writer.reserve_strtab_section_index();
    writer.reserve_shstrtab_section_index();
    writer.reserve_symtab();
    writer.reserve_strtab();
    writer.reserve_shstrtab();
    writer.reserve_section_headers();

    let header = FileHeader {
        os_abi: elf::ELFOSABI_NONE,
        abi_version: 0,
        e_type: elf::ET_EXEC,
        e_machine: elf::EM_ARM,
        e_entry: 0,
        e_flags: 0,
    };
    writer.write_file_header(&header).unwrap();
    for (segment, offset) in segments.iter().zip(&offsets) {
        writer.write_program_header(&ProgramHeader {
            p_type: elf::PT_LOAD,
            p_flags: elf::PF_R,
            p_offset: *offset as u64,
            p_vaddr: segment.run.into(),
            p_paddr: segment.load.into(),
            p_filesz: segment.data.len() as u64,
            p_memsz: segment.size.into(),
            p_align: 4,
        });
    }
    for segment in segments {
        writer.write_align(4);
        writer.write(segment.data);
    }
    writer.write_null_symbol();
    for (&(_, address, size), name) in symbols.iter().zip(names) {
        let home = segments
            .iter()
            .position(|segment| (segment.run..segment.run + segment.size).contains(&address));
        // A function's address has the Thumb bit.
        let kind = if address & 1 == 1 {
            elf::STT_FUNC
        } else {
            elf::STT_OBJECT
        };
        writer.write_symbol(&Sym {
            name: Some(name),
            section: Some(sections[home.expect("a symbol in a segment")].1),
            st_info: elf::STB_GLOBAL << 4 | kind,
            st_other: 0,
            st_shndx: 0,
            st_value: address.into(),
            st_size: size.into(),
        });
    }
    writer.write_strtab();
    writer.write_shstrtab();
    writer.write_null_section_header();
    for ((segment, offset), (name, _)) in segments.iter().zip(offsets).zip(sections) {
        writer.write_section_header(&SectionHeader {
            name: Some(name),
            sh_type: if segment.data.is_empty() {
                elf::SHT_NOBITS
            } else {
                elf::SHT_PROGBITS
            },
            sh_flags: elf::SHF_ALLOC.into(),
            sh_addr: segment.run.into(),
            sh_offset: offset as u64,
            sh_size: segment.size.into(),
            sh_link: 0,
            sh_info: 0,
            sh_addralign: 4,
            sh_entsize: 0,
        });
    }
    writer.write_symtab_section_header(1);
    writer.write_strtab_section_header();
    writer.write_shstrtab_section_header();
    bytes
}
