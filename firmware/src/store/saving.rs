//! A save, or a record of outputs.

use core::iter;

use register_map::board::{Board, Each};
use register_map::record::{Encoder, FIRST_OFFSET, OUTPUTS_SCHEMA, SCHEMA};

use super::copied::{Copied, is_setting};
use super::operation::{Operation, Readying, Writing};
use super::survey::record_at;
use super::{Newest, Page, Pages, Store, WriteError};
use crate::config::Settings;

/// The values to store.
#[derive(Clone, Copy, Debug)]
pub enum Given<'a, B: Board> {
    /// All settings.
    Settings(&'a Settings<B>),
    /// The outputs that are to start as they were, as pairs of a record.
    Outputs(&'a [(u16, u16)]),
}

/// A save or a record of outputs under way. Pass the same values to every call.
#[derive(Clone, Debug)]
pub struct Saving<B: Board> {
    readying: Readying,
    writing: Writing,
    /// Address after the setting that was stored last, or index of the next output.
    cursor: u16,
    /// The outputs that follow the settings of a save, or the settings in front of outputs.
    copied: Each<B::Kept, Copied>,
    /// The operation that failed.
    failed: Option<Operation>,
}

impl<B: Board> Saving<B> {
    /// Begins a save of these settings. Returns `None` when they are already stored.
    #[must_use]
    pub fn of_settings(
        store: &Store<B>,
        flash: &impl Pages,
        settings: &Settings<B>,
    ) -> Option<Self> {
        let newest = store.newest();
        let stored =
            newest.and_then(|newest| record_at::<B>(flash.page(newest.page), newest.place.offset));
        if stored.is_some_and(|stored| {
            let pairs = stored.pairs().filter(is_setting::<B>);
            pairs.eq(settings.changed_from(0))
        }) {
            return None;
        }
        let sequence = newest.map_or(1, |newest| newest.place.sequence.wrapping_add(1));
        // There are at most as many settings as addresses.
        let count = settings
            .changed_from(0)
            .fold(0, |count: u16, _| count.saturating_add(1));
        let copied = store.stored_outputs(flash);
        let count = copied.iter().fold(count, |count, outputs| {
            count.saturating_add(outputs.count())
        });
        let encoder = Encoder::new(SCHEMA, sequence, count);
        Some(Self::new(place(store, encoder.size()), encoder, copied))
    }

    /// Begins a record of outputs: after the newest record if it fits there, or else on the other page together with the
    /// stored settings. Returns `None` when these outputs are already stored, and when no settings are or leave no room.
    #[must_use]
    pub fn of_outputs(
        store: &Store<B>,
        flash: &impl Pages,
        outputs: &[(u16, u16)],
    ) -> Option<Self> {
        let Newest {
            page,
            place: newest,
        } = store.newest()?;
        let mut copied = store.stored_outputs(flash);
        let [stored] = &mut copied[..] else {
            return None;
        };
        if iter::from_fn(|| stored.next(flash)).eq(outputs.iter().copied()) {
            return None;
        }
        *stored = Copied::NOTHING;
        let count = outputs.len() as u16;
        let mut encoder = Encoder::new(OUTPUTS_SCHEMA, newest.sequence, count);
        let survey = store.survey(page);
        let mut place = (page, survey.end, Readying::Done);
        if survey.room() < encoder.size() {
            let record = record_at::<B>(flash.page(page), newest.offset)?;
            *stored = Copied::settings::<B>(&record, page, newest.offset);
            let sequence = newest.sequence.wrapping_add(1);
            let count = count.saturating_add(stored.count());
            encoder = Encoder::new(record.schema, sequence, count);
            // Those of a later firmware may fill the page.
            if encoder.size() > flash.page(page).len().saturating_sub(FIRST_OFFSET) {
                return None;
            }
            place = self::place(store, encoder.size());
        }
        Some(Self::new(place, encoder, copied))
    }

    fn new(
        (page, offset, readying): (Page, usize, Readying),
        encoder: Encoder,
        copied: Each<B::Kept, Copied>,
    ) -> Self {
        Self {
            readying,
            writing: Writing::new(page, offset, encoder),
            cursor: 0,
            copied,
            failed: None,
        }
    }

    /// Performs the operations that are left, one after the other.
    ///
    /// # Errors
    ///
    /// When an operation fails. The next call begins with it.
    pub fn perform<F: Pages>(
        &mut self,
        flash: &mut F,
        given: Given<'_, B>,
    ) -> Result<(), WriteError<F::Error>> {
        while let Some(operation) = self.failed.take().or_else(|| self.next(flash, given)) {
            if let Err(error) = operation.perform(flash) {
                self.failed = Some(operation);
                return Err(error);
            }
        }
        Ok(())
    }

    /// Returns the next operation, or `None` when all are done.
    fn next(&mut self, flash: &impl Pages, given: Given<'_, B>) -> Option<Operation> {
        if let Some(operation) = self.readying.next() {
            return Some(operation);
        }
        let (cursor, copied) = (&mut self.cursor, &mut self.copied);
        self.writing.next(&mut || {
            let mut copied = copied.iter_mut();
            let mut copy = || copied.next()?.next(flash);
            match given {
                Given::Outputs(outputs) if B::ROW.keeps_outputs => copy().or_else(|| {
                    let pair = outputs.get(usize::from(*cursor)).copied();
                    *cursor = cursor.saturating_add(1);
                    pair
                }),
                Given::Outputs(_) => None,
                Given::Settings(settings) => match settings.changed_from(*cursor).next() {
                    Some(pair) => {
                        *cursor = pair.0.saturating_add(1);
                        Some(pair)
                    }
                    None => copy(),
                },
            }
        })
    }

    /// Ends the save after the last operation, or after one that failed.
    ///
    /// # Errors
    ///
    /// When the record is not stored.
    pub fn finish<F: Pages>(
        &self,
        store: &mut Store<B>,
        flash: &F,
    ) -> Result<(), WriteError<F::Error>> {
        store.survey_again(flash);
        let Writing { page, offset, .. } = self.writing;
        if store.survey(page).end == offset {
            Ok(())
        } else {
            store.avoid(page);
            Err(WriteError::Worn)
        }
    }
}

/// Returns where a record of this size goes, and the steps that prepare the place: after the newest record, or else
/// on the other page, which is erased only if the record does not fit there either.
fn place<B: Board>(store: &Store<B>, size: usize) -> (Page, usize, Readying) {
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
