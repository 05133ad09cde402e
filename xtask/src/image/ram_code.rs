//! The promise that code in RAM calls nothing in flash: it runs while flash cannot be read.
//!
//! A branch from RAM does not reach flash, so that the linker (lld) makes a thunk for each such call and puts it near
//! the caller.

use object::read::elf::Sym;

use super::{RAM_BASE, parse};

/// How lld names a thunk, before the name of what it leads to.
const THUNK: &str = "__Thumbv7ABSLongThunk_";

/// The functions in flash that code in RAM calls.
///
/// # Errors
///
/// When it is no image.
pub fn calls_into_flash(bytes: &[u8]) -> Result<Vec<String>, String> {
    let elf = parse(bytes)?;
    let endian = elf.endian();
    let symbols = elf.elf_symbol_table();
    let thunks = symbols.iter().filter_map(|symbol| {
        let name = symbols.symbol_name(endian, symbol).ok()?;
        let name = str::from_utf8(name).ok()?.strip_prefix(THUNK)?;
        (symbol.st_value(endian) >= RAM_BASE)
            .then(|| format!("{:#}", rustc_demangle::demangle(name)))
    });
    Ok(thunks.collect())
}

#[cfg(test)]
mod tests {
    use super::super::FLASH_BASE;
    use super::super::sample::{self, Segment};
    use super::*;

    #[test]
    fn only_a_thunk_in_ram_leads_into_flash() {
        let image = |thunk| {
            let name = "__Thumbv7ABSLongThunk__ZN8firmware5store4load17h0123456789abcdefE";
            let code = [
                Segment::at(FLASH_BASE, &[0; 16]),
                Segment::at(RAM_BASE, &[0; 32]),
            ];
            sample::elf(&code, &[("TIM2", RAM_BASE, 8), (name, thunk, 10)])
        };
        let called = calls_into_flash(&image(RAM_BASE + 16));
        assert_eq!(called, Ok(vec!["firmware::store::load".to_owned()]));
        assert_eq!(calls_into_flash(&image(FLASH_BASE + 4)), Ok(vec![]));
    }
}
