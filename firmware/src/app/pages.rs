//! Implements the store's flash trait for the board's flash.

use board_support::flash::{Flash, FlashError};
use firmware::store::{self, Page};

use crate::board::BOARD;

/// The store's two pages.
pub struct Pages(pub Flash);

const fn address(page: Page) -> u32 {
    let [first, second] = BOARD.store.addresses();
    match page {
        Page::First => first,
        Page::Second => second,
    }
}

impl Pages {
    /// Returns whether the supply is high enough to change the pages.
    pub fn has_supply(&self) -> bool {
        self.0.has_supply()
    }
}

impl store::Flash for Pages {
    type Error = FlashError;

    fn page(&self, page: Page) -> &[u8] {
        let [first, second] = self.0.pages();
        match page {
            Page::First => first,
            Page::Second => second,
        }
    }

    fn program(&mut self, page: Page, offset: usize, half: u16) -> Result<(), FlashError> {
        self.0
            .program_half_word(address(page).wrapping_add(offset as u32), half)
    }

    fn erase(&mut self, page: Page) -> Result<(), FlashError> {
        self.0.erase_page(address(page))
    }
}
