//! The promise that a release image cannot panic: nothing that panics is linked.
//!
//! Every panic of Rust, be it an index, an `unwrap` or an arithmetic check, ends in a function of
//! `core::panicking`, which the linker keeps only if something can call it.

use object::elf::STT_FUNC;
use object::read::elf::Sym;

use super::{Elf, FLASH_BASE, parse};

/// A function that panics, and who calls it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Panic {
    /// Its path, such as `core::panicking::panic_bounds_check`.
    pub name: String,
    /// The paths of the functions with a direct call to it.
    pub callers: Vec<String>,
}

/// A function of the image.
struct Function {
    name: String,
    address: u32,
    size: u32,
}

/// The panicking functions that are linked into an image, whose flash begins with the bytes of `flash`.
///
/// # Errors
///
/// When it is no image, or has no symbols to tell by.
pub fn linked(bytes: &[u8], flash: &[u8]) -> Result<Vec<Panic>, String> {
    let functions = functions(&parse(bytes)?)?;
    if functions.is_empty() {
        return Err("the image has no symbols: whether it can panic cannot be told".to_owned());
    }
    let panics = functions.iter().filter(|function| panics(&function.name));
    Ok(panics
        .map(|panic| Panic {
            name: panic.name.clone(),
            callers: callers(panic.address, &functions, flash),
        })
        .collect())
}

/// `core::panicking`, and the panic handler it calls.
fn panics(name: &str) -> bool {
    name.starts_with("core::panicking::") || name.ends_with("rust_begin_unwind")
}

fn functions(elf: &Elf<'_>) -> Result<Vec<Function>, String> {
    let endian = elf.endian();
    let symbols = elf.elf_symbol_table();
    let functions = symbols.iter().filter(|symbol| symbol.st_type() == STT_FUNC);
    functions
        .map(|symbol| {
            let name = symbols
                .symbol_name(endian, symbol)
                .map_err(|error| format!("the image is broken: {error}"))?;
            let name = String::from_utf8_lossy(name);
            Ok(Function {
                name: format!("{:#}", rustc_demangle::demangle(&name)),
                // Bit 0 is the Thumb bit.
                address: symbol.st_value(endian) & !1,
                size: symbol.st_size(endian),
            })
        })
        .collect()
}

fn callers(target: u32, functions: &[Function], flash: &[u8]) -> Vec<String> {
    let calls = |function: &&Function| {
        let start = function.address.checked_sub(FLASH_BASE);
        let end = start.and_then(|start| start.checked_add(function.size));
        let code = start
            .zip(end)
            .and_then(|(start, end)| flash.get(start as usize..end as usize));
        let halves: Vec<u16> = code
            .unwrap_or_default()
            .chunks_exact(2)
            .map(|half| u16::from_le_bytes([half[0], half[1]]))
            .collect();
        (function.address..)
            .step_by(2)
            .zip(halves.windows(2))
            .any(|(at, pair)| branch(at, pair[0], pair[1]) == Some(target))
    };
    let callers = functions.iter().filter(calls);
    callers.map(|function| function.name.clone()).collect()
}

/// Where a BL or a B.W goes, encodings T1 and T4 (Armv7-M manual A7.7.18 and A7.7.12); `None` for any
/// other pair of half-words.
fn branch(at: u32, first: u16, second: u16) -> Option<u32> {
    if first & 0xF800 != 0xF000 || second & 0x9000 != 0x9000 {
        return None;
    }
    let (first, second) = (u32::from(first), u32::from(second));
    let sign = first >> 10 & 1;
    let i1 = 1 ^ (second >> 13 & 1) ^ sign;
    let i2 = 1 ^ (second >> 11 & 1) ^ sign;
    let offset = sign << 24 | i1 << 23 | i2 << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1;
    // 25 bits with a sign.
    let offset = (offset << 7).cast_signed() >> 7;
    Some(at.wrapping_add(4).wrapping_add_signed(offset))
}

#[cfg(test)]
mod tests {
    use super::super::sample::{self, Segment};
    use super::*;

    /// `main` at the start, a panicking function 0x100 bytes later.
    const PANIC: u32 = FLASH_BASE + 0x100;

    /// What is linked into an image with this code and this panicking function.
    fn linked_into(code: &[u8], panic: &str) -> Result<Vec<Panic>, String> {
        let mut flash = vec![0; 0x110];
        flash[..code.len()].copy_from_slice(code);
        let functions = [("main", FLASH_BASE | 1, 0x20), (panic, PANIC | 1, 8)];
        let elf = sample::elf(&[Segment::at(FLASH_BASE, &flash)], &functions);
        linked(&elf, &flash)
    }

    #[test]
    fn a_panicking_function_is_found_with_its_callers() {
        // nop; bl +0xFA: assembled with llvm-mc.
        let code = [0x00, 0xBF, 0x00, 0xF0, 0x7D, 0xF8];
        let found = linked_into(&code, "_ZN4core9panicking5panic17h0123456789abcdefE");
        let expected = Panic {
            name: "core::panicking::panic".to_owned(),
            callers: vec!["main".to_owned()],
        };
        assert_eq!(found, Ok(vec![expected]));
        let handler = linked_into(&[], "rust_begin_unwind").unwrap();
        assert_eq!((handler.len(), handler[0].callers.len()), (1, 0));
    }

    #[test]
    fn an_image_without_one_is_good() {
        assert_eq!(linked_into(&[], "modio::panicking_not"), Ok(Vec::new()));
    }

    #[test]
    fn without_symbols_there_is_no_telling() {
        let stripped = sample::elf(&[Segment::at(FLASH_BASE, &[0; 8])], &[]);
        assert!(
            linked(&stripped, &[0; 8])
                .unwrap_err()
                .contains("no symbols")
        );
    }

    #[test]
    fn branches_lead_where_the_processor_goes() {
        // From the image's disassembly: bl, b.w, bl backwards.
        assert_eq!(branch(0x0800_0000, 0xF000, 0xF800), Some(0x0800_0004));
        assert_eq!(branch(0x0800_0000, 0xF7FF, 0xFFFE), Some(0x0800_0000));
        assert_eq!(branch(0x0800_0010, 0xF000, 0xB880), Some(0x0800_0114));
        assert_eq!(branch(0x0800_0000, 0xF8D0, 0x9000), None, "ldr.w");
    }
}
