//! Where a part that is updated over the line keeps its loader, its two images, the boot state and the configuration.

use crate::part::{FLASH_BASE, KIB, Part};

/// Bytes of the loader, at the beginning of flash.
pub const LOADER: u32 = 16 * KIB;

/// Address of the [numbers of the loader's keys](crate::update::keys), its last bytes.
pub const LOADER_KEYS: u32 = FLASH_BASE + LOADER - crate::update::keys::BYTES as u32;

/// Bytes of the header of an image. The application follows.
pub const HEADER: u32 = 512;

/// Two flash pages that hold records. Each can be erased separately.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TwoPages {
    /// Address of the first page. The second one follows.
    pub first: u32,
    /// Bytes of a page, the smallest unit that can be erased.
    pub bytes: u32,
}

impl TwoPages {
    /// Returns the last two pages of flash that ends at an offset.
    pub(crate) const fn before(end: u32, part: &Part) -> Self {
        Self {
            first: FLASH_BASE + end - 2 * part.page,
            bytes: part.page,
        }
    }

    /// Returns the addresses of both pages.
    #[must_use]
    pub const fn addresses(self) -> [u32; 2] {
        [self.first, self.first + self.bytes]
    }
}

/// The layout of the flash: loader, slot A, slot B, boot state, configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Addresses of slots A and B.
    pub slots: [u32; 2],
    /// Bytes of a slot: the header and the application.
    pub slot: u32,
    /// The pages of the boot state.
    pub boot: TwoPages,
    /// The pages of the configuration.
    pub store: TwoPages,
}

impl Layout {
    /// Returns the layout of a part.
    pub(crate) const fn of(part: &Part) -> Self {
        let store = TwoPages::before(part.flash, part);
        let boot = TwoPages::before(part.flash - 2 * part.page, part);
        let a = FLASH_BASE + LOADER;
        let slot = (boot.first - a) / 2 / part.page * part.page;
        Self {
            slots: [a, a + slot],
            slot,
            boot,
            store,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::board::{MODIO_02, MODIO_08};

    use super::*;

    #[test]
    fn every_part_has_two_equal_slots_of_whole_pages() {
        let of = |board: &crate::Row| {
            let Layout {
                slots: [a, b],
                slot,
                boot,
                store,
            } = board.layout();
            [a, b, slot / KIB, boot.first, store.first].map(|number| number & 0xFF_FFFF)
        };
        assert_eq!(of(&MODIO_02), [0x4000, 0x1_1800, 54, 0x1_F000, 0x1_F800]);
        assert_eq!(of(&MODIO_08), [0x4000, 0x2_1000, 116, 0x3_E000, 0x3_F000]);
    }
}
