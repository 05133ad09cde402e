//! A save, one flash operation at a time.

use register_map::record::{Encoder, FIRST_OFFSET, SCHEMA};

use super::operation::{Operation, Readying, Writing};
use super::survey::record_at;
use super::{Page, Pages, Store, WriteError};
use crate::config::Settings;

/// A save under way. Pass the same settings to every step.
#[derive(Clone, Debug)]
pub struct Saving {
    readying: Readying,
    writing: Writing,
    sequence: u32,
    /// Address after the setting that was stored last.
    cursor: u16,
}

impl Saving {
    /// Begins a save of these settings. Returns `None` when they are already stored.
    #[must_use]
    pub fn new<const SLOTS: usize>(
        store: &Store,
        flash: &impl Pages,
        settings: &Settings<SLOTS>,
    ) -> Option<Self> {
        let newest = store.newest();
        let stored =
            newest.and_then(|newest| record_at(flash.page(newest.page), newest.place.offset));
        if stored.is_some_and(|stored| stored.pairs().eq(settings.changed_from(0))) {
            return None;
        }
        let sequence = newest.map_or(1, |newest| newest.place.sequence.wrapping_add(1));
        // There are at most as many settings as addresses.
        let count = settings
            .changed_from(0)
            .fold(0, |count: u16, _| count.saturating_add(1));
        let encoder = Encoder::new(SCHEMA, sequence, count);
        let (page, offset, readying) = place(store, encoder.size());
        Some(Self {
            readying,
            writing: Writing::new(page, offset, encoder),
            sequence,
            cursor: 0,
        })
    }

    /// Returns the next operation, to be performed before the next call, or `None` when all are done.
    pub fn next<const SLOTS: usize>(&mut self, settings: &Settings<SLOTS>) -> Option<Operation> {
        if let Some(operation) = self.readying.next() {
            return Some(operation);
        }
        let cursor = &mut self.cursor;
        self.writing.next(&mut || {
            let pair = settings.changed_from(*cursor).next()?;
            *cursor = pair.0.saturating_add(1);
            Some(pair)
        })
    }

    /// Ends the save after the last operation, or after one that failed.
    ///
    /// # Errors
    ///
    /// When the settings are not stored.
    pub fn finish<F: Pages>(
        &self,
        store: &mut Store,
        flash: &F,
    ) -> Result<(), WriteError<F::Error>> {
        store.survey_again(flash);
        match store.newest() {
            Some(newest) if newest.place.sequence == self.sequence => Ok(()),
            _ => {
                store.avoid(self.writing.page);
                Err(WriteError::Worn)
            }
        }
    }
}

/// Returns where a record of this size goes, and the steps that prepare the place: after the newest record, or else
/// on the other page, which is erased only if the record does not fit there either.
fn place(store: &Store, size: usize) -> (Page, usize, Readying) {
    let active = store.newest().map(|newest| newest.page);
    let first = active.unwrap_or(Page::First);
    for page in [first, first.other()] {
        let survey = store.survey(page);
        if survey.room() >= size {
            return (page, survey.end, Readying::Done);
        }
    }
    let page = active.map_or_else(|| store.least_wanted(), Page::other);
    let readying = Readying::new(page, store.survey(page).marked);
    (page, FIRST_OFFSET, readying)
}
