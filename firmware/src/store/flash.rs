//! What the store needs of a flash.

/// One of the store's two pages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Page {
    /// At the lower address.
    First,
    /// At the higher address.
    Second,
}

impl Page {
    /// The one that this is not.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }
}

/// Two pages of a flash that is programmed by half-words and erased by pages (RM0008 3.3).
///
/// An operation that is cut off may leave anything in the half-word or page it was for, and nothing
/// anywhere else.
pub trait Flash {
    /// Why an operation was refused or failed.
    type Error;

    /// The bytes of a page as they are. Both pages have as many, 1024 or more.
    fn page(&self, page: Page) -> &[u8];

    /// Programs a half-word, which must be erased unless `half` is 0, at an even offset: 40 to 70 us
    /// during which nothing else runs from this flash.
    ///
    /// # Errors
    ///
    /// When the flash reports one.
    fn program(&mut self, page: Page, offset: usize, half: u16) -> Result<(), Self::Error>;

    /// Erases a page: 20 to 40 ms during which nothing else runs from this flash.
    ///
    /// # Errors
    ///
    /// When the flash reports one.
    fn erase(&mut self, page: Page) -> Result<(), Self::Error>;
}

/// Why something could not be stored. Nothing that was stored before is lost by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError<E> {
    /// The flash refused or failed: with the page, it may be worn out.
    Flash(Page, E),
    /// What was programmed at this offset does not read back: the page is worn out.
    Worn(Page, usize),
}
