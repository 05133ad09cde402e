//! Functions that can panic.

use std::collections::BTreeSet;

use anyhow::{Result, ensure};
use object::{Object as _, ObjectSection as _};

use super::{Elf, Symbol, demangled};

/// A crate whose panics are accepted: its indices are those of loops with constant bounds, which the compiler does not
/// see through at this optimisation level. It is the only crate with cryptography that fits the loader.
const ACCEPTED: &str = "salty::";

/// Refuses an image in which a function can panic. Every panic of Rust calls a function of `core::panicking` or the
/// panic handler, and the linker keeps only functions that something can call.
pub fn check(elf: &Elf<'_>, symbols: &[Symbol]) -> Result<()> {
    let functions = symbols.iter().filter(|symbol| symbol.function);
    let functions: Vec<_> = functions
        .map(|symbol| (symbol, demangled(&symbol.name)))
        .collect();
    ensure!(
        !functions.is_empty(),
        "the image has no symbols, so it is unknown whether it can panic"
    );
    let panics = functions.iter().filter(|(_, name)| {
        name.starts_with("core::panicking::") || name.ends_with("rust_begin_unwind")
    });
    let (mut reached, names): (BTreeSet<u32>, Vec<&str>) = panics
        .map(|(symbol, name)| (symbol.address, name.as_str()))
        .unzip();
    let calls: Vec<_> = functions
        .iter()
        .map(|(symbol, name)| (symbol.address, name.as_str(), calls(elf, symbol)))
        .collect();
    // The functions of core that lead to a panic, and then the functions of other crates that call these.
    let callers = loop {
        let leads = calls.iter().filter(|(address, _, calls)| {
            !reached.contains(address) && !calls.is_disjoint(&reached)
        });
        let (core, others): (Vec<_>, Vec<_>) = leads
            .map(|(address, name, _)| (*address, *name))
            .partition(|(_, name)| name.starts_with("core::"));
        if core.is_empty() {
            break others;
        }
        reached.extend(core.iter().map(|(address, _)| *address));
    };
    // The name of an implementation begins with its type.
    let is_accepted = |name: &str| name.trim_start_matches(['<', '&']).starts_with(ACCEPTED);
    let accepted = !callers.is_empty() && callers.iter().all(|(_, name)| is_accepted(name));
    ensure!(
        names.is_empty() || accepted,
        "the image can panic, which a release image must not; remove the calls to {} (docs/architecture.md shows how \
         to find them)",
        names.join(", ")
    );
    Ok(())
}

/// Returns the addresses that a function calls, or jumps to outside its own code: BL and B.W (ARMv7-M ARM, A7.7.12 and
/// A7.7.18).
fn calls(elf: &Elf<'_>, function: &Symbol) -> BTreeSet<u32> {
    let size = u64::from(function.size);
    let mut sections = elf.sections();
    let code = sections.find_map(|section| {
        let data = section.data_range(function.address.into(), size);
        data.ok().flatten()
    });
    let (halves, _) = code.unwrap_or_default().as_chunks();
    let halves: Vec<u16> = halves
        .iter()
        .map(|half| u16::from_le_bytes(*half))
        .collect();
    let mut calls = BTreeSet::new();
    for (n, pair) in halves.windows(2).enumerate() {
        let [first, second] = [pair[0], pair[1]].map(u32::from);
        if first >> 11 != 0b11110 || second & 0x9000 != 0x9000 {
            continue;
        }
        let sign = first >> 10 & 1;
        let [i1, i2] = [13, 11].map(|bit| !(second >> bit ^ sign) & 1);
        let offset = i1 << 23 | i2 << 22 | (first & 0x3FF) << 12 | (second & 0x7FF) << 1;
        // The sign is bit 24.
        let offset = offset | 0_u32.wrapping_sub(sign) << 24;
        let next = function.address + 2 * n as u32 + 4;
        calls.insert(next.wrapping_add(offset));
    }
    calls
}
