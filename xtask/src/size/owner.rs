//! The crate of a symbol, from its name.

/// Names in crate `compiler_builtins` of the functions that the compiler calls.
const BUILTINS: [&str; 4] = ["__aeabi_", "mem", "__rust_", "bcmp"];

/// Start-up code, exception vectors and interrupt handlers, which have the names of the linker script or of the
/// hardware.
pub const NAMED: &str = "(vectors, handlers, start-up)";

/// Returns the crate of a symbol.
pub fn of(symbol: &str) -> String {
    let Ok(name) = rustc_demangle::try_demangle(symbol) else {
        let builtin = BUILTINS.iter().any(|prefix| symbol.starts_with(prefix));
        return if builtin { "compiler_builtins" } else { NAMED }.to_owned();
    };
    // Leave out the hash, or the crate's disambiguator.
    let name = format!("{name:#}");
    crate_of(&name).unwrap_or(NAMED).to_owned()
}

/// Returns the crate at the start of a path. For `<type as trait>` it is that of the type, or where the type has no
/// crate (`&str`, `u32`, `[T]`) that of the trait.
fn crate_of(path: &str) -> Option<&str> {
    let Some(inner) = path.strip_prefix('<') else {
        return head(path);
    };
    let (implementor, of_trait) = inner.split_once(" as ").unwrap_or((inner, ""));
    let sigils = |c: char| !c.is_alphanumeric() && c != '_';
    let bare = implementor.trim_start_matches(sigils);
    let words = ["mut ", "dyn ", "const "].into_iter();
    let bare = words.fold(bare, |bare, word| bare.strip_prefix(word).unwrap_or(bare));
    head(bare.trim_start_matches(sigils)).or_else(|| head(of_trait))
}

/// Returns `a` of `a::b`, when `a` is a plain name.
fn head(path: &str) -> Option<&str> {
    let (first, _) = path.split_once("::")?;
    let plain = !first.is_empty() && first.chars().all(|c| c.is_alphanumeric() || c == '_');
    plain.then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crate_is_found_in_both_manglings_and_in_names_of_the_compiler() {
        for (symbol, name) in [
            (
                "_ZN13modbus_server3crc5crc1617h0123456789abcdefE",
                "modbus_server",
            ),
            ("_RNvCskwGfYPst2Cb_3foo16example_function", "foo"),
            (
                "_ZN50_$LT$firmware..App$u20$as$u20$core..fmt..Debug$GT$3fmt17h0123456789abcdefE",
                "firmware",
            ),
            ("__aeabi_memcpy4", "compiler_builtins"),
            ("memcpy", "compiler_builtins"),
            ("USART1", NAMED),
        ] {
            assert_eq!(of(symbol), name);
        }
    }

    #[test]
    fn implementation_belongs_to_its_type_or_else_to_its_trait() {
        for (path, name) in [
            ("core::ptr::drop_in_place<firmware::App>", Some("core")),
            ("<firmware::App>::run", Some("firmware")),
            (
                "<modio_drivers::Di<P> as rtic::IoModule>::scan",
                Some("modio_drivers"),
            ),
            (
                "<&mut modbus_server::Frame as core::fmt::Debug>::fmt",
                Some("modbus_server"),
            ),
            (
                "<[fugit::Duration; 3] as core::fmt::Debug>::fmt",
                Some("fugit"),
            ),
            ("<&u32 as core::fmt::Debug>::fmt", Some("core")),
            ("<str as heapless::Sealed>::x", Some("heapless")),
            ("<*const u8 as rtic::Monotonic>::now", Some("rtic")),
            ("<dyn core::fmt::Write as nb::block::Yes>::x", Some("core")),
            ("main", None),
        ] {
            assert_eq!(crate_of(path), name, "{path}");
        }
    }
}
