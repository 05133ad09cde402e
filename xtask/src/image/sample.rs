//! Small images for tests.

use object::elf;

/// A load segment, which is a section at the same time: load address, run address, data, size in memory.
pub type Segment<'a> = (u32, u32, &'a [u8], u32);

/// A function or variable: name, address, size. The address of a function has the Thumb bit.
pub type Symbol<'a> = (&'a str, u32, u32);

/// Returns code or constants that are used at their load address.
pub fn code(address: u32, data: &[u8]) -> Segment<'_> {
    (address, address, data, data.len() as u32)
}

/// Returns an ELF file for an Arm core with these contents: header, program headers, data, section headers.
pub fn elf(segments: &[Segment], symbols: &[Symbol]) -> Vec<u8> {
    let count = segments.len() as u32;
    let start = 52 + 32 * count;
    let mut data: Vec<u8> = Vec::new();
    let mut put = |bytes: &[u8]| {
        let at = start + data.len() as u32;
        data.extend(bytes);
        data.resize(data.len().next_multiple_of(4), 0);
        at
    };
    let (mut programs, mut sections) = (Vec::new(), vec![0; 10]);
    for &(load, run, bytes, size) in segments {
        let at = put(bytes);
        // Offsets of names in `.shstrtab`.
        let (name, kind) = match (bytes.is_empty(), load == run) {
            (true, _) => (1, elf::SHT_NOBITS),
            (false, true) => (6, elf::SHT_PROGBITS),
            (false, false) => (12, elf::SHT_PROGBITS),
        };
        programs.extend([elf::PT_LOAD, at, run, load, bytes.len() as u32, size, 0, 1]);
        sections.extend([name, kind, elf::SHF_ALLOC, run, at, size, 0, 0, 1, 0]);
    }
    let (mut table, mut names) = (vec![0; 4], vec![0]);
    for &(name, address, size) in symbols {
        let inside = |&(_, run, _, size): &Segment| address.wrapping_sub(run) < size;
        let segment = segments.iter().position(inside).expect("a segment");
        let function = address & 1 == 1;
        let kind = if function {
            elf::STT_FUNC
        } else {
            elf::STT_OBJECT
        };
        let info = u32::from(elf::STB_GLOBAL << 4 | kind) | (segment as u32 + 1) << 16;
        table.extend([names.len() as u32, address, size, info]);
        names.extend(name.bytes().chain([0]));
    }
    let shared = b"\0.bss\0.text\0.data\0.symtab\0.strtab\0.shstrtab\0";
    for (name, kind, bytes, link, entry) in [
        (18, elf::SHT_SYMTAB, words(&table), count + 2, 16),
        (26, elf::SHT_STRTAB, names, 0, 0),
        (34, elf::SHT_STRTAB, shared.to_vec(), 0, 0),
    ] {
        let at = put(&bytes);
        sections.extend([name, kind, 0, 0, at, bytes.len() as u32, link, 1, 1, entry]);
    }
    let place = put(&[]);
    // 32 bits, little-endian; an executable for Arm; then places, sizes and numbers of the headers.
    let (arm, programs_of, sections_of) = (40 << 16 | 2, 32 << 16 | 52, 40 << 16 | count);
    let end = (count + 3) << 16 | (count + 4);
    let mut file = words(&[0x464C457F, 0x00010101, 0, 0, arm, 1, 0, 52, place, 0]);
    file.extend(words(&[programs_of, sections_of, end]));
    [file, words(&programs), data, words(&sections)].concat()
}

fn words(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}
