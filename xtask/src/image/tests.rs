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

/// Returns the error of an image with this code in `main`, and with this function 0x100 bytes later.
fn error_of(code: [u8; 6], function: &str) -> Option<String> {
    let mut flash = vec![0; 0x110];
    flash[..6].copy_from_slice(&code);
    let functions = [
        ("main", FLASH_BASE | 1, 0x20),
        (function, (FLASH_BASE + 0x100) | 1, 8),
    ];
    let image = elf(&[super::sample::code(FLASH_BASE, &flash)], &functions);
    check(&image).err().map(|error| error.to_string())
}

#[test]
fn panicking_function_is_refused_with_its_callers() {
    // Assembled with llvm-mc.
    let bl = [0x00, 0xBF, 0x00, 0xF0, 0x7D, 0xF8];
    let branch = [0x00, 0xF0, 0x7E, 0xB8, 0x00, 0xBF];
    let load = [0xD8, 0xF8, 0x00, 0x90, 0x00, 0xBF];
    for (code, function, expected) in [
        (
            bl,
            "_ZN4core9panicking5panic17h0123456789abcdefE",
            "core::panicking::panic, called by main",
        ),
        (
            branch,
            "rust_begin_unwind",
            "rust_begin_unwind, called by main",
        ),
        (load, "rust_begin_unwind", "rust_begin_unwind, called by "),
    ] {
        let text = error_of(code, function).unwrap();
        assert!(text.ends_with(&format!("\n  {expected}")), "{text}");
    }
    assert_eq!(error_of(bl, "modio::panicking_not"), None);
    let stripped = elf(&[code(FLASH_BASE, &[0; 8])], &[]);
    let text = check(&stripped).unwrap_err().to_string();
    assert!(text.contains("no symbols"), "{text}");
}

#[test]
fn only_a_thunk_in_ram_leads_into_flash() {
    let checked = |thunk| {
        let name = "__Thumbv7ABSLongThunk__ZN8firmware5store4load17h0123456789abcdefE";
        let both = [code(FLASH_BASE, &[0; 16]), code(RAM_BASE, &[0; 32])];
        check(&elf(&both, &[("TIM2", RAM_BASE | 1, 8), (name, thunk, 10)]))
    };
    let refused = checked(RAM_BASE + 16).unwrap_err().to_string();
    assert!(refused.ends_with("\n  firmware::store::load"), "{refused}");
    assert!(checked(FLASH_BASE + 4).is_ok());
}
