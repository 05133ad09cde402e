use super::sample::{code, elf};
use super::*;

const FLASH_SIZE: u32 = 128 * 1024;

#[test]
fn segments_are_placed_at_their_load_addresses_with_erased_gaps() {
    let data = (FLASH_BASE + 8, RAM_BASE, &[4, 5][..], 16);
    let bss = (RAM_BASE + 16, RAM_BASE + 16, &[][..], 4096);
    let image = elf(&[code(FLASH_BASE, &[1, 2, 3]), data, bss], &[]);
    let expected = [1, 2, 3, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 4, 5];
    assert_eq!(flat(&image, FLASH_SIZE).unwrap(), expected);
}

#[test]
fn segment_outside_flash_is_refused_with_its_address() {
    let last = FLASH_BASE + FLASH_SIZE - 4;
    for address in [FLASH_BASE - 4, last + 2, RAM_BASE, u32::MAX - 3] {
        let image = elf(&[code(address, &[0; 4])], &[]);
        let text = flat(&image, FLASH_SIZE).unwrap_err().to_string();
        assert!(text.contains(&format!("{address:#010x}")), "{text}");
    }
    assert!(flat(&elf(&[code(last, &[0; 4])], &[]), FLASH_SIZE).is_ok());
}

#[test]
fn file_that_is_no_image_is_refused() {
    let text = |bytes: &[u8]| format!("{:#}", flat(bytes, FLASH_SIZE).unwrap_err());
    assert_eq!(text(&elf(&[], &[])), "the image loads nothing");
    assert!(text(b"#!/bin/sh").contains("not a 32-bit ELF"));
    let whole = elf(&[code(FLASH_BASE, &[7; 64])], &[]);
    let start = whole.windows(64).position(|bytes| bytes == [7; 64]);
    assert!(flat(&whole[..start.unwrap() + 10], FLASH_SIZE).is_err());
}

/// Returns the panics of an image with this code in `main`, and with this function 0x100 bytes later.
fn panics_of(code: &[u8], function: &str) -> Vec<(String, Vec<String>)> {
    let mut flash = vec![0; 0x110];
    flash[..code.len()].copy_from_slice(code);
    let functions = [
        ("main", FLASH_BASE | 1, 0x20),
        (function, (FLASH_BASE + 0x100) | 1, 8),
    ];
    panics(&elf(&[super::sample::code(FLASH_BASE, &flash)], &functions)).unwrap()
}

#[test]
fn panicking_function_is_found_with_its_callers() {
    // nop; bl +0xFA: assembled with llvm-mc.
    let code = [0x00, 0xBF, 0x00, 0xF0, 0x7D, 0xF8];
    let found = panics_of(&code, "_ZN4core9panicking5panic17h0123456789abcdefE");
    let expected = ("core::panicking::panic".to_owned(), vec!["main".to_owned()]);
    assert_eq!(found, [expected]);
    let handler = panics_of(&[], "rust_begin_unwind");
    assert_eq!(handler, [("rust_begin_unwind".to_owned(), vec![])]);
    assert_eq!(panics_of(&code, "modio::panicking_not"), []);
}

#[test]
fn image_without_symbols_is_refused() {
    let stripped = elf(&[code(FLASH_BASE, &[0; 8])], &[]);
    let text = panics(&stripped).unwrap_err().to_string();
    assert!(text.contains("no symbols"), "{text}");
}

#[test]
fn branch_targets_are_those_of_the_disassembly() {
    // bl, bl backwards, b.w, ldr.w.
    assert_eq!(branch(0x0800_0000, 0xF000, 0xF800), Some(0x0800_0004));
    assert_eq!(branch(0x0800_0000, 0xF7FF, 0xFFFE), Some(0x0800_0000));
    assert_eq!(branch(0x0800_0010, 0xF000, 0xB880), Some(0x0800_0114));
    assert_eq!(branch(0x0800_0000, 0xF8D0, 0x9000), None);
}

#[test]
fn only_a_thunk_in_ram_leads_into_flash() {
    let image = |thunk| {
        let name = "__Thumbv7ABSLongThunk__ZN8firmware5store4load17h0123456789abcdefE";
        let both = [code(FLASH_BASE, &[0; 16]), code(RAM_BASE, &[0; 32])];
        elf(&both, &[("TIM2", RAM_BASE, 8), (name, thunk, 10)])
    };
    let called = |thunk| calls_from_ram(&image(thunk)).unwrap();
    assert_eq!(called(RAM_BASE + 16), ["firmware::store::load"]);
    assert!(called(FLASH_BASE + 4).is_empty());
}
