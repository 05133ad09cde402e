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

/// Returns the error of an image in which a function with this name calls `core::panicking::panic`.
fn error_of_caller(name: &str) -> String {
    // BL to the next function but one, and BX LR three times.
    let mut data = vec![0x00, 0xF0, 0x02, 0xF8, 0x70, 0x47, 0x70, 0x47, 0x70, 0x47];
    data.resize(16, 0);
    let symbols = [
        (name, FLASH_BASE | 1, 6),
        ("core::panicking::panic", (FLASH_BASE + 8) | 1, 2),
    ];
    let segments = [code(FLASH_BASE, &data), code(RAM_BASE, &[0; 32])];
    let checked = check(&elf(&segments, &symbols));
    checked.map_or_else(|error| error.to_string(), |()| "none".to_owned())
}

#[test]
fn only_the_crate_with_the_signatures_may_call_a_panicking_function() {
    assert_eq!(error_of_caller("salty::hash::Sha512::update"), "none");
    for name in [
        "loader::main",
        "core::slice::index::fail",
        "pepper::salty::x",
    ] {
        assert!(error_of_caller(name).contains("can panic"), "{name}");
    }
}

/// Returns what the function `user` in RAM uses, by the error of an image in which it consists of this code and these
/// constants. The image has a function and a constant in flash.
fn use_in_ram(code_of_user: &[u16], constants: &[u32]) -> Option<String> {
    let mut data = code_of_user
        .iter()
        .flat_map(|half| half.to_le_bytes())
        .collect::<Vec<_>>();
    let pool = RAM_BASE + data.len() as u32;
    data.extend(constants.iter().flat_map(|word| word.to_le_bytes()));
    let symbols = [
        ("store::load", (FLASH_BASE + 8) | 1, 8),
        ("TABLE", FLASH_BASE + 16, 8),
        ("user", RAM_BASE | 1, data.len() as u32),
        ("$t", RAM_BASE, 0),
        ("$d.1", pool, 0),
    ];
    let segments = [code(FLASH_BASE, &[0; 24]), code(RAM_BASE, &data)];
    let refused = check(&elf(&segments, &symbols)).err()?.to_string();
    let (_, uses) = refused.split_once("user uses ").expect("the user");
    Some(uses.split(';').next().unwrap().to_owned())
}

#[test]
fn code_in_ram_with_an_address_in_flash_is_refused() {
    for address in [FLASH_BASE + 16, FLASH_BASE + 20] {
        let found = use_in_ram(&[0x4800, 0x4770], &[RAM_BASE, address]);
        assert_eq!(found.as_deref(), Some("TABLE"));
    }
    // A thunk: movw ip, #9; movt ip, #0x800; bx ip.
    let thunk = [0xF240, 0x0C09, 0xF6C0, 0x0C00, 0x4760, 0xBF00];
    assert_eq!(use_in_ram(&thunk, &[]).as_deref(), Some("store::load"));
    let nameless = use_in_ram(&[0x4770, 0xBF00], &[FLASH_BASE + 0x1_2345]);
    assert_eq!(nameless.as_deref(), Some("0x08012345"));
    // The same bits as code; an address in RAM and a register of USART1 as constants.
    assert_eq!(
        use_in_ram(&[0x0010, 0x0800], &[RAM_BASE, 0x4001_3800]),
        None
    );
}

#[test]
fn code_in_ram_that_calls_or_jumps_through_a_register_is_refused() {
    let indirect = [
        [0x4798, 0xBF00],
        [0x4718, 0xBF00],
        [0x469F, 0xBF00],
        [0x449F, 0xBF00],
        [0xF8D3, 0xF004],
        [0xF853, 0xF021],
    ];
    for code in indirect {
        let found = use_in_ram(&code, &[]);
        let expected = Some("an address in a register");
        assert_eq!(found.as_deref(), expected, "{code:04X?}");
    }
    // bx lr, pop {pc}, ldr pc, [sp], #4, b.w, bl, tbb, and movt to an address in RAM.
    let direct = [
        [0x4770, 0xBD00],
        [0xF85D, 0xFB04],
        [0xF000, 0xB800],
        [0xF000, 0xF800],
        [0xE8DF, 0xF000],
        [0xF2C2, 0x0000],
    ];
    for code in direct {
        assert_eq!(use_in_ram(&code, &[]), None, "{code:04X?}");
    }
}
