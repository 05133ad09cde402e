//! The configuration in a board's flash, read and written from outside the firmware.

use std::ops::Range;

use register_map::{Module, configuration, record};

use super::Layout;
use f103::memory::FLASH_BASE;

impl Layout {
    /// Returns the two pages of the configuration, as ranges of the flash. They are elsewhere in a flash with a loader.
    pub(super) fn pages(&self, flash: &[u8]) -> [Range<usize>; 2] {
        let store = match self.holds_loader(flash) {
            true => self.board.layout().store,
            false => self.board.store(),
        };
        store.addresses().map(|address| {
            let start = (address - FLASH_BASE) as usize;
            start..start + store.bytes as usize
        })
    }

    /// Returns whether both pages of the configuration are empty in this flash.
    #[must_use]
    pub fn stores_nothing(&self, flash: &[u8]) -> bool {
        let vacant = |page: &Range<usize>| flash.get(page.clone()).is_some_and(record::is_vacant);
        self.pages(flash).iter().all(vacant)
    }

    /// Returns the setting of the register at `address` in the newest configuration in this flash. `None` if the
    /// configuration does not have this register, so that its default is in force.
    #[must_use]
    pub fn stored(&self, flash: &[u8], address: u16) -> Option<u16> {
        let pages = self.pages(flash);
        let records = pages
            .iter()
            .filter_map(|page| flash.get(page.clone()))
            .flat_map(|page| record::records(page, self.board))
            .map(|(_, record)| record)
            .filter(|record| !record.holds_outputs());
        let newest = records.reduce(|newest, record| {
            if record::is_newer(record.sequence, newest.sequence) {
                record
            } else {
                newest
            }
        })?;
        let mut pairs = newest.pairs();
        pairs.find(|(at, _)| *at == address).map(|(_, value)| value)
    }

    /// Returns the module that is stored in this flash for the slot at `port`.
    #[must_use]
    pub fn configured(&self, flash: &[u8], port: u8) -> Module {
        let code = self.stored(flash, configuration::module_of(port.into()));
        code.and_then(Module::from_code).unwrap_or(Module::None)
    }

    /// Stores these settings (address and value of a register) in a flash without a configuration. Returns whether they
    /// fit into a page.
    pub fn store(&self, flash: &mut [u8], settings: &[(u16, u16)]) -> bool {
        let [first, _] = self.pages(flash);
        let Some(page) = flash.get_mut(first) else {
            return false;
        };
        page.fill(0xFF);
        record::encode_page(0, settings, page).is_some()
    }

    /// Returns an erased flash with these settings (address and value of a register) as its configuration; `None` if
    /// they do not fit into a page.
    #[must_use]
    pub fn flash_with(&self, settings: &[(u16, u16)]) -> Option<Vec<u8>> {
        let mut flash = vec![0xFF; self.part.flash_size];
        self.store(&mut flash, settings).then_some(flash)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::MODIO_08;

    #[test]
    fn settings_are_stored_in_the_first_page_of_the_board() {
        let settings = [(0x0110, 1), (0x0113, 5)];
        let mut flash = MODIO_08.flash_with(&settings).unwrap();
        assert!(!MODIO_08.stores_nothing(&flash));
        let page = &flash[0x3_F000..0x3_F800];
        let (_, record) = record::records(page, MODIO_08.board).next().unwrap();
        assert!(record.pairs().eq(settings));
        let ports = [1, 2, 4].map(|port| MODIO_08.configured(&flash, port));
        assert_eq!(ports, [Module::Di4, Module::None, Module::Ao4]);
        flash[0x3_F000..0x3_F800].fill(0xFF);
        assert!(MODIO_08.stores_nothing(&flash));
        flash[0x3_FFFE] = 0;
        assert!(
            !MODIO_08.stores_nothing(&flash),
            "the second page is not empty"
        );
    }

    #[test]
    fn newest_record_of_both_pages_has_the_stored_setting() {
        let mut flash = MODIO_08.flash_with(&[(0x0103, 1), (0x0110, 4)]).unwrap();
        assert_eq!(MODIO_08.stored(&flash, 0x0103), Some(1));
        assert_eq!(MODIO_08.stored(&flash, 0x0104), None);
        let second = &mut flash[0x3_F800..0x4_0000];
        record::encode_page(7, &[(0x0110, 2)], second).unwrap();
        assert_eq!(
            MODIO_08.stored(&flash, 0x0103),
            None,
            "the newer record does not have this setting"
        );
        assert_eq!(MODIO_08.stored(&flash, 0x0110), Some(2));
        assert_eq!(MODIO_08.stored(&[0xFF; 0x4_0000], 0x0110), None);
    }

    #[test]
    fn settings_larger_than_a_page_are_not_stored() {
        let settings = [(0, 0); 512];
        assert_eq!(MODIO_08.flash_with(&settings), None);
        assert!(!MODIO_08.store(&mut [], &[]));
    }
}
