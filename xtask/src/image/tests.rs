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

/// Returns the error of an image with these functions.
fn error_of(functions: &[(&str, u32, u32)]) -> String {
    let segments = [code(FLASH_BASE, &[0; 16]), code(RAM_BASE, &[0; 32])];
    let checked = check(&elf(&segments, functions));
    checked.map_or_else(|error| error.to_string(), |()| "none".to_owned())
}

#[test]
fn panicking_function_is_refused() {
    for (function, name) in [
        (
            "_ZN4core9panicking5panic17h0123456789abcdefE",
            "core::panicking::panic",
        ),
        ("rust_begin_unwind", "rust_begin_unwind"),
    ] {
        let text = error_of(&[("main", FLASH_BASE | 1, 4), (function, FLASH_BASE | 5, 4)]);
        assert!(
            text.contains(&format!("remove the calls to {name} (")),
            "{text}"
        );
    }
    assert_eq!(
        error_of(&[("modio::panicking_not", FLASH_BASE | 1, 4)]),
        "none"
    );
    assert!(error_of(&[]).contains("no symbols"));
}

#[test]
fn only_a_thunk_in_ram_leads_into_flash() {
    let name = "__Thumbv7ABSLongThunk__ZN8firmware5store4load17h0123456789abcdefE";
    let at = |thunk| error_of(&[("TIM2", RAM_BASE | 1, 8), (name, thunk, 10)]);
    let refused = at(RAM_BASE + 16);
    assert!(
        refused.contains("add firmware::store::load to"),
        "{refused}"
    );
    assert_eq!(at(FLASH_BASE + 4), "none");
}
