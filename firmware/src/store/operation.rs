//! The single flash operations of the store.

use register_map::record::{Encoder, PAGE_MARK};

use super::{Page, Pages, WriteError};

/// One flash operation, the longest step during which nothing else can run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operation {
    /// Program a half-word.
    Program {
        /// Page of the half-word.
        page: Page,
        /// Even offset of the half-word, in bytes.
        offset: usize,
        /// Value of the half-word.
        half: u16,
    },
    /// Erase a page.
    Erase(Page),
}

impl Operation {
    /// Performs the operation and checks the result.
    ///
    /// # Errors
    ///
    /// When the flash failed or does not read back as expected.
    pub fn perform<F: Pages>(self, flash: &mut F) -> Result<(), WriteError<F::Error>> {
        match self {
            Self::Program { page, offset, half } => {
                let done = flash.program(page, offset, half);
                done.map_err(WriteError::Flash)?;
                let read = flash.page(page).get(offset..).unwrap_or_default();
                if read.first_chunk() == Some(&half.to_le_bytes()) {
                    Ok(())
                } else {
                    Err(WriteError::Worn)
                }
            }
            Self::Erase(page) => {
                let done = flash.erase(page);
                done.map_err(WriteError::Flash)?;
                if flash.page(page).iter().all(|byte| *byte == 0xFF) {
                    Ok(())
                } else {
                    Err(WriteError::Worn)
                }
            }
        }
    }
}

/// The steps that prepare a page: destroy its mark, erase it, program a new mark. An interrupted erase never leaves
/// a page that looks prepared.
#[derive(Clone, Copy, Debug)]
pub(super) enum Readying {
    Spoil(Page),
    Erase(Page),
    Mark(Page),
    Done,
}

impl Readying {
    /// Returns the steps for a page; `marked` says whether it has its mark.
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
            // 0 can be programmed over any value.
            Self::Spoil(page) => (mark(page, 0), Self::Erase(page)),
            Self::Erase(page) => (Operation::Erase(page), Self::Mark(page)),
            Self::Mark(page) => (mark(page, PAGE_MARK), Self::Done),
            Self::Done => return None,
        };
        *self = then;
        Some(operation)
    }
}

/// The steps that write a record.
#[derive(Clone, Debug)]
pub(super) struct Writing {
    pub(super) page: Page,
    /// Offset of the next half-word, in the end that after the record.
    pub(super) offset: usize,
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

    /// Returns the next operation, or `None` when the record is complete. [`Encoder::next`] describes `pair`.
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
