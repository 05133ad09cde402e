//! Code in RAM that uses flash, which cannot be read during a save.
//!
//! Mapping symbols, `$t` and `$d`, say where code and constants begin (ELF for the Arm Architecture, section 5.5.5).

use std::collections::BTreeMap;
use std::ops::Range;

use anyhow::{Context as _, Result, ensure};
use object::{Object as _, ObjectSection as _, SectionKind};
use register_map::Row;

use super::{Elf, FLASH_BASE, RAM_BASE, Symbol, demangled};

/// Addresses of flash in the largest part that a board has. A larger range would also refuse constants that only look like
/// addresses.
const FLASH: Range<u32> = {
    let (mut bytes, mut n) = (0, 0);
    while n < Row::ALL.len() {
        let part = Row::ALL[n].memory.part;
        if part.flash > bytes {
            bytes = part.flash;
        }
        n += 1;
    }
    FLASH_BASE..FLASH_BASE + bytes
};

/// Refuses code in RAM that contains an address in flash, or that calls or jumps to an address in a register, which may
/// be in flash.
///
/// A branch from RAM does not reach flash, so lld makes a thunk in RAM for each such call. The thunk contains the
/// address.
pub fn check(elf: &Elf<'_>, symbols: &[Symbol]) -> Result<()> {
    let is_ram = |address: u64| address >= u64::from(RAM_BASE);
    let mut sections = elf
        .sections()
        .filter(|section| section.kind() == SectionKind::Text && is_ram(section.address()))
        .peekable();
    ensure!(sections.peek().is_some(), "the image has no code in RAM");
    // The first use of each function.
    let mut uses = BTreeMap::new();
    for section in sections {
        let data = section.data().context("the image is broken")?;
        let base = section.address() as u32;
        for (range, is_code) in parts(base, data.len(), symbols) {
            let bytes = &data[range.clone()];
            let start = base + range.start as u32;
            let found = if is_code {
                in_code(bytes)
            } else {
                in_constants(bytes, start)
            };
            if let Some((at, what)) = found {
                let user = name_at(symbols, start + at as u32);
                uses.entry(user).or_insert_with(|| match what {
                    Use::Address(address) => name_at(symbols, address),
                    Use::Register => "an address in a register".to_owned(),
                });
            }
        }
    }
    let uses: Vec<_> = uses
        .iter()
        .map(|(user, what)| format!("{user} uses {what}"))
        .collect();
    ensure!(
        uses.is_empty(),
        "code in RAM uses flash, which cannot be read during a save: {}; change it, or add what it uses to .ram_code \
         in board-support/memory/sections.x",
        uses.join(", ")
    );
    Ok(())
}

/// How code in RAM can use flash.
#[derive(Debug, PartialEq)]
enum Use {
    Address(u32),
    Register,
}

/// Returns the parts of a section in order, as offsets, and whether each is code.
fn parts(base: u32, length: usize, symbols: &[Symbol]) -> Vec<(Range<usize>, bool)> {
    let marks = symbols.iter().filter_map(|symbol| {
        let is_code = symbol.name.starts_with("$t");
        let is_data = symbol.name.starts_with("$d") || !symbol.function && symbol.size > 0;
        let at = symbol.address.checked_sub(base)? as usize;
        (at < length && (is_code || is_data)).then_some((at, is_code))
    });
    let mut marks: Vec<_> = marks.chain([(0, false), (length, false)]).collect();
    marks.sort_unstable();
    let parts = marks.windows(2);
    parts.map(|two| (two[0].0..two[1].0, two[0].1)).collect()
}

/// Returns the first address in flash among these constants, with its offset.
fn in_constants(bytes: &[u8], start: u32) -> Option<(usize, Use)> {
    let skipped = start.next_multiple_of(4).wrapping_sub(start) as usize;
    let (words, _) = bytes.get(skipped..)?.as_chunks();
    let mut words = words.iter().map(|word| u32::from_le_bytes(*word)).zip(0..);
    let (word, n) = words.find(|(word, _)| FLASH.contains(word))?;
    Some((skipped + 4 * n, Use::Address(word)))
}

/// Returns the first use of flash by this Thumb code, with its offset. The encodings are in the ARMv7-M ARM, A7.7.
fn in_code(bytes: &[u8]) -> Option<(usize, Use)> {
    let (halves, _) = bytes.as_chunks();
    let mut halves = halves.iter().map(|half| u16::from_le_bytes(*half)).zip(0..);
    // The value that MOVW has written to each register.
    let mut low = [0; 16];
    while let Some((first, n)) = halves.next() {
        let is_wide = first >> 11 > 0b11100;
        let second = if is_wide { halves.next()?.0 } else { 0 };
        let register = usize::from(second >> 8 & 0xF);
        // The 16 bits of MOVW and MOVT.
        let value = first << 12 | (first & 1 << 10) << 1 | second >> 4 & 0x700 | second & 0xFF;
        let found = match first {
            // BX and BLX, except BX LR; ADD PC and MOV PC.
            0x4770 => None,
            _ if matches!(first & 0xFF00, 0x4700) || matches!(first & 0xFF87, 0x4487 | 0x4687) => {
                Some(Use::Register)
            }
            _ if is_wide && first & 0xFBF0 == 0xF240 => {
                low[register] = value;
                None
            }
            _ if is_wide && first & 0xFBF0 == 0xF2C0 => {
                let address = u32::from(value) << 16 | u32::from(low[register]);
                FLASH.contains(&address).then_some(Use::Address(address))
            }
            // LDR PC, except from the stack.
            _ if is_wide && first & 0xFF70 == 0xF850 && second >> 12 == 15 && first & 0xF != 13 => {
                Some(Use::Register)
            }
            _ => None,
        };
        if let Some(found) = found {
            return Some((2 * n, found));
        }
    }
    None
}

/// Returns the name of the function or variable at an address, or the address.
fn name_at(symbols: &[Symbol], address: u32) -> String {
    let at = |symbol: &&Symbol| {
        symbol.size > 0 && (symbol.address..symbol.address + symbol.size).contains(&(address & !1))
    };
    let symbol = symbols.iter().find(at);
    symbol.map_or_else(|| format!("{address:#010x}"), |it| demangled(&it.name))
}
