//! What the firmware was built from. The build script asks git.

/// The first 32 bits of the commit; 0 when that is not known.
pub const COMMIT: u32 = match option_env!("MODIO_COMMIT") {
    Some(digits) => number(digits),
    None => 0,
};

/// The register BUILD: bit 0 the sources had changes that are not in the commit, 2 not signed.
pub const FLAGS: u16 = NOT_SIGNED
    | if option_env!("MODIO_CHANGED").is_some() {
        CHANGED
    } else {
        0
    };

const CHANGED: u16 = 1 << 0;
const NOT_SIGNED: u16 = 1 << 2;

const fn number(digits: &str) -> u32 {
    match u32::from_str_radix(digits, 16) {
        Ok(number) => number,
        Err(_) => panic!("eight hexadecimal digits"),
    }
}
