//! The commit that the firmware was built from.

/// Eight digits, and `-dirty` when the sources had other changes; `unknown` outside a git repository.
const TEXT: &str = register_map::commit!();

/// First 32 bits of the commit; 0 when it is not known.
pub const COMMIT: u32 = register_map::first_32_bits(TEXT);

/// Value of the register BUILD: bit 0 means that the sources had changes that are not in the commit, bit 4 that their
/// version is no release.
pub const FLAGS: u16 = match TEXT.as_bytes() {
    [.., b'-', b'd', b'i', b'r', b't', b'y'] => 1,
    _ => 0,
} | match env!("CARGO_PKG_VERSION_PRE").as_bytes() {
    [] => 0,
    _ => register_map::state::build::PRE_RELEASE,
};
