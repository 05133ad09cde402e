//! The flash pages that keep data without power, and a slot for an image, as those see them that write them.
//!
//! docs/decisions.md says why these are not the traits of embedded-storage.

/// One of the store's two pages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Page {
    /// At the lower address.
    First,
    /// At the higher address.
    Second,
}

impl Page {
    /// Returns the other page.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::First => Self::Second,
            Self::Second => Self::First,
        }
    }
}

/// Why something could not be written to pages. What was there before is still in force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WriteError<E> {
    /// The flash refused an operation or failed. The page may be worn out.
    Flash(E),
    /// The flash does not read back as programmed: the page is worn out.
    Worn,
}

impl<E> From<E> for WriteError<E> {
    fn from(error: E) -> Self {
        Self::Flash(error)
    }
}

/// Two pages of a flash that is programmed by half-words and erased by pages (RM0008 3.3).
///
/// An operation that is interrupted may leave any content in its half-word or page, and does not change anything
/// else.
pub trait Pages {
    /// Error of an operation.
    type Error;

    /// Returns the bytes of a page. Both pages have the same size, 1024 or more.
    fn page(&self, page: Page) -> &[u8];

    /// Programs a half-word at an even offset, which must be erased unless `half` is 0. This takes 40 to 70 us,
    /// during which nothing else runs from this flash.
    ///
    /// # Errors
    ///
    /// When the flash reports an error.
    fn program(&mut self, page: Page, offset: usize, half: u16) -> Result<(), Self::Error>;

    /// Erases a page. This takes 20 to 40 ms, on clones of the part up to 400, during which nothing else runs from this
    /// flash.
    ///
    /// # Errors
    ///
    /// When the flash reports an error.
    fn erase(&mut self, page: Page) -> Result<(), Self::Error>;
}

/// A slot of such a flash, for an image.
pub trait Slot {
    /// Error of an operation.
    type Error;

    /// Returns the bytes of the slot.
    fn bytes(&self) -> &[u8];

    /// Returns the bytes of a page. The slot begins at a page and has whole pages.
    fn page_bytes(&self) -> usize;

    /// Programs a half-word at an even offset, as [`Pages::program`].
    ///
    /// # Errors
    ///
    /// When the flash reports an error.
    fn program(&mut self, offset: usize, half: u16) -> Result<(), Self::Error>;

    /// Erases a page of the slot, as [`Pages::erase`].
    ///
    /// # Errors
    ///
    /// When the flash reports an error.
    fn erase(&mut self, page: usize) -> Result<(), Self::Error>;
}
