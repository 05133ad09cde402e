//! The slot's module as a simulator or a programmer can leave it in flash: a stop-gap until there is
//! a configuration store, whose MODULE register takes its place.
//!
//! ```text
//! 0x0800_FC00  0x4D4F   marks a preset
//! 0x0800_FC02  code     of the module, 0 to 6
//! ```

use crate::Module;

/// Where the preset stands: the last page of a 64 KiB part.
pub const ADDRESS: u32 = 0x0800_FC00;

/// Bytes of a preset.
pub const LEN: usize = 4;

const MARK: u16 = 0x4D4F;

/// The bytes to write at [`ADDRESS`] for a module.
#[must_use]
pub const fn encode(module: Module) -> [u8; LEN] {
    let mark = MARK.to_le_bytes();
    let code = module.code().to_le_bytes();
    [mark[0], mark[1], code[0], code[1]]
}

/// The module preset by these bytes, or `None` when there is none or it is damaged.
#[must_use]
pub const fn decode(bytes: [u8; LEN]) -> Option<Module> {
    if u16::from_le_bytes([bytes[0], bytes[1]]) == MARK {
        Module::from_code(u16::from_le_bytes([bytes[2], bytes[3]]))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preset_is_read_back_and_nothing_else_is_taken_for_one() {
        for module in Module::ALL {
            assert_eq!(decode(encode(module)), Some(module));
        }
        assert_eq!(decode([0xFF; LEN]), None, "erased flash");
        assert_eq!(decode([0x4F, 0x4D, 7, 0]), None, "no such module");
    }
}
