//! Whose a symbol is: the crate that its name says.

/// Names that crate `compiler_builtins` gives to what the compiler calls by itself.
const BUILTINS: [&str; 4] = ["__aeabi_", "mem", "__rust_", "bcmp"];

/// Startup code, exception vectors and interrupt handlers bear the names that the linker script or
/// the hardware knows them by.
pub const NAMED: &str = "(vectors, handlers, start-up)";

/// The crate of a symbol.
#[must_use]
pub fn of(symbol: &str) -> String {
    let Ok(name) = rustc_demangle::try_demangle(symbol) else {
        let builtin = BUILTINS.iter().any(|prefix| symbol.starts_with(prefix));
        return if builtin { "compiler_builtins" } else { NAMED }.to_owned();
    };
    // Without the hash, or the crate's disambiguator.
    let name = format!("{name:#}");
    crate_of(&name).unwrap_or(NAMED).to_owned()
}

/// The crate at the head of a path; of `<type as trait>` the type's, or where that is of no crate
/// (`&str`, `u32`, `[T]`) the trait's.
fn crate_of(path: &str) -> Option<&str> {
    let path = match path.strip_prefix('<') {
        Some(inner) => inner,
        None => return head(path),
    };
    let implementor = path.split(" as ").next().unwrap_or(path);
    let bare = implementor.trim_start_matches(|c: char| !c.is_alphanumeric() && c != '_');
    let bare = ["mut ", "dyn ", "const "]
        .iter()
        .fold(bare, |bare, word| bare.strip_prefix(word).unwrap_or(bare));
    let bare = bare.trim_start_matches(|c: char| !c.is_alphanumeric() && c != '_');
    head(bare).or_else(|| {
        path.split_once(" as ")
            .and_then(|(_, of_trait)| head(of_trait))
    })
}

/// `a` of `a::b`, when `a` is a plain name.
fn head(path: &str) -> Option<&str> {
    let (first, _) = path.split_once("::")?;
    let plain = !first.is_empty() && first.chars().all(|c| c.is_alphanumeric() || c == '_');
    plain.then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_manglings_are_understood() {
        // Legacy, and v0.
        assert_eq!(
            of("_ZN13modbus_server3crc5crc1617h0123456789abcdefE"),
            "modbus_server"
        );
        assert_eq!(of("_RNvCskwGfYPst2Cb_3foo16example_function"), "foo");
        assert_eq!(
            of("_ZN50_$LT$firmware..App$u20$as$u20$core..fmt..Debug$GT$3fmt17h0123456789abcdefE"),
            "firmware"
        );
    }

    #[test]
    fn names_that_are_no_rust_paths_have_their_places() {
        assert_eq!(of("__aeabi_memcpy4"), "compiler_builtins");
        assert_eq!(of("memcpy"), "compiler_builtins");
        assert_eq!(of("USART1"), NAMED);
        assert_eq!(of("Reset"), NAMED);
    }

    #[test]
    fn an_implementation_is_its_types_or_else_its_traits() {
        for (path, name) in [
            ("core::ptr::drop_in_place<firmware::App>", "core"),
            ("<firmware::App>::run", "firmware"),
            (
                "<modio_drivers::Di<P> as modio_drivers::IoModule>::scan",
                "modio_drivers",
            ),
            (
                "<&mut modbus_server::Frame as core::fmt::Debug>::fmt",
                "modbus_server",
            ),
            ("<[fugit::Duration; 3] as core::fmt::Debug>::fmt", "fugit"),
            ("<&u32 as core::fmt::Debug>::fmt", "core"),
            ("<str as heapless::Sealed>::x", "heapless"),
            ("<*const u8 as rtic::Monotonic>::now", "rtic"),
            ("<dyn core::fmt::Write as nb::block::Yes>::x", "core"),
        ] {
            assert_eq!(crate_of(path), Some(name), "{path}");
        }
        assert_eq!(crate_of("main"), None);
    }
}
