//! The single operations a store does on its flash.

use register_map::record::{Encoder, PAGE_MARK};

use super::{Flash, Page, StoreError};

/// One operation on the flash, the most that is done without a chance for anything else to run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// Program a half-word.
    Program {
        /// Where.
        page: Page,
        /// At which even offset.
        offset: usize,
        /// With what.
        half: u16,
    },
    /// Erase a page.
    Erase(Page),
}

impl Operation {
    /// Does it and looks whether it was done.
    ///
    /// # Errors
    ///
    /// When the flash failed, or does not read as it should.
    pub fn perform<F: Flash>(self, flash: &mut F) -> Result<(), StoreError<F::Error>> {
        match self {
            Self::Program { page, offset, half } => {
                let done = flash.program(page, offset, half);
                done.map_err(|error| StoreError::Flash(page, error))?;
                let read = flash.page(page).get(offset..).unwrap_or_default();
                if read.first_chunk() == Some(&half.to_le_bytes()) {
                    Ok(())
                } else {
                    Err(StoreError::Worn(page, offset))
                }
            }
            Self::Erase(page) => {
                let done = flash.erase(page);
                done.map_err(|error| StoreError::Flash(page, error))?;
                match flash.page(page).iter().position(|byte| *byte != 0xFF) {
                    None => Ok(()),
                    Some(offset) => Err(StoreError::Worn(page, offset)),
                }
            }
        }
    }
}

/// What makes a page ready: its mark destroyed, an erase, a new mark. An erase that was cut off leaves
/// no page that looks ready.
#[derive(Clone, Copy, Debug)]
pub(super) enum Readying {
    Spoil(Page),
    Erase(Page),
    Mark(Page),
    Done,
}

impl Readying {
    /// For a page that has its mark, or has none.
    pub(super) const fn new(page: Page, marked: bool) -> Self {
        if marked {
            Self::Spoil(page)
        } else {
            Self::Erase(page)
        }
    }

    pub(super) fn next(&mut self) -> Option<Operation> {
        let mark = |page, half| Operation::Program {
            page,
            offset: 0,
            half,
        };
        let (operation, then) = match *self {
            // Zero may be programmed over anything.
            Self::Spoil(page) => (mark(page, 0), Self::Erase(page)),
            Self::Erase(page) => (Operation::Erase(page), Self::Mark(page)),
            Self::Mark(page) => (mark(page, PAGE_MARK), Self::Done),
            Self::Done => return None,
        };
        *self = then;
        Some(operation)
    }
}

/// What writes a record.
#[derive(Clone, Debug)]
pub(super) struct Writing {
    pub(super) page: Page,
    offset: usize,
    encoder: Encoder,
}

impl Writing {
    pub(super) const fn new(page: Page, offset: usize, encoder: Encoder) -> Self {
        Self {
            page,
            offset,
            encoder,
        }
    }

    /// Where the next half-word goes.
    pub(super) const fn offset(&self) -> usize {
        self.offset
    }

    /// The next operation; `None` when the record is complete. For `pair` see [`Encoder::next`].
    pub(super) fn next(
        &mut self,
        pair: &mut dyn FnMut() -> Option<(u16, u16)>,
    ) -> Option<Operation> {
        let half = self.encoder.next(pair)?;
        let offset = self.offset;
        self.offset = offset.saturating_add(2);
        Some(Operation::Program {
            page: self.page,
            offset,
            half,
        })
    }
}
