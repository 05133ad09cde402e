//! The board's flash as the store takes it.

use board_support::{
    design::STORE_PAGES,
    flash::{Flash, FlashError},
};
use firmware::store::{self, Page};
use register_map::record::{PAGE_ADDRESSES, PAGE_SIZE};

const _: () = {
    let ([a, b], [first, second]) = (STORE_PAGES, PAGE_ADDRESSES);
    assert!(
        a == first && b == second,
        "board and map mean the same pages"
    );
};

/// The store's two pages.
pub struct Pages(pub Flash);

const fn address(page: Page) -> u32 {
    let [first, second] = PAGE_ADDRESSES;
    match page {
        Page::First => first,
        Page::Second => second,
    }
}

impl Pages {
    /// Whether the supply is high enough to change the pages.
    pub fn has_supply(&self) -> bool {
        self.0.has_supply()
    }
}

impl store::Flash for Pages {
    type Error = FlashError;

    fn page(&self, page: Page) -> &[u8; PAGE_SIZE] {
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
