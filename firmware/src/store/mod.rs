//! The configuration store: two flash pages, so that a power cut never loses the last valid configuration.
//!
//! [`register_map::record`] describes the layout. Records are appended to the *active* page; the newest valid one
//! counts. When the page is full, the next record goes to the other page, which is kept erased: by
//! [`Store::prepare`] at the start, before the line is served, and by [`Store::make_spare`] after every change of
//! pages, when the caller can wait. So a save does not erase in normal use and delays the line only by the time for
//! one half-word.
//!
//! ```text
//!   active page                       other page
//!   +------+---+---+-----+--------+   +------+---------------------------+
//!   | mark | 1 | 2 | 3   | erased |   | mark | erased                    |   in use: record 3 counts
//!   +------+---+---+-----+--------+   +------+---------------------------+
//!   | mark | 1 | 2 | 3   | 4 |    |   | mark | erased                    |   after a save that fits
//!   | mark | 1 | 2 | 3   | 4 |    |   | mark | 5 |                       |   after a save that does not fit
//!   | mark | erased               |   | mark | 5 |                       |   after `make_spare` or a start
//!   +------+----------------------+   +------+---+-----------------------+
//! ```
//!
//! The outputs that start as they were are pairs in the record of the settings, after these. When only they change, a
//! record of outputs alone follows the settings. A save and a move to the other page copy the newest of them. So settings
//! and outputs always change pages together, and a record of outputs stores no unsaved setting.
//!
//! Why a power cut during any operation does no harm:
//!
//! - A record counts once its first seal is programmed, after its CRC is complete. Until then the previous record
//!   counts, and the page with the newest record is never erased. So a CRC whose cells read differently from
//!   start to start has no effect.
//! - A start that finds only one seal programs both again. From then on the first one reads the same every time.
//! - Nothing is written after the remains of an interrupted write: the next start moves the newest record to the
//!   other page (*compaction*) and erases this one.
//! - A page is used only when it has its mark. The mark is destroyed before an erase and programmed after it, so a
//!   page that was erased only partly, and may read as erased, is not mistaken for an erased page.
//! - A device that never stored anything first stores a record of defaults, so that a valid record exists before
//!   the first save, too.
//! - When something was stored but no record is valid, the defaults are in force and the damage is reported at
//!   every start until something is saved. One page is left unchanged as evidence.

mod copied;
mod operation;
mod saving;
mod survey;

use core::marker::PhantomData;

use register_map::board::{Board, Each};
use register_map::record::{Encoder, FIRST_OFFSET, Record, SCHEMA};

use crate::config::Settings;
use copied::Copied;
pub use operation::Operation;
use operation::{Readying, Writing};
pub use ports::pages::{Page, Pages, WriteError};
pub use saving::{Given, Saving};
use survey::{Place, Survey, record_at};

/// A start moves the newest record to the other page when fewer bytes than this follow it and older records precede
/// it.
const LITTLE_ROOM: usize = 256;

/// The configuration that a start found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loaded<B: Board> {
    /// The stored settings, or the defaults.
    pub settings: Settings<B>,
    /// Something was stored but no record is valid: `settings` are the defaults.
    pub invalid: bool,
    /// Number of stored values that this board or firmware does not allow. They have their defaults instead.
    pub rejected: u16,
}

impl<B: Board> Loaded<B> {
    /// Returns whether the flash holds something else than these settings.
    #[must_use]
    pub const fn is_invalid(&self) -> bool {
        self.invalid || self.rejected > 0
    }
}

/// The valid record that counts.
#[derive(Clone, Copy, Debug)]
struct Newest {
    page: Page,
    place: Place,
}

/// The state of the two pages.
#[derive(Clone, Debug)]
pub struct Store<B> {
    first: Survey,
    second: Survey,
    board: PhantomData<B>,
}

impl<B: Board> Store<B> {
    /// Examines both pages.
    #[must_use]
    pub fn open(flash: &impl Pages) -> Self {
        Self {
            first: Survey::of::<B>(flash.page(Page::First)),
            second: Survey::of::<B>(flash.page(Page::Second)),
            board: PhantomData,
        }
    }

    /// Returns the stored configuration, as far as this board allows it. [`Self::prepare`] uses the same record.
    #[must_use]
    pub fn load(&mut self, flash: &impl Pages) -> Loaded<B> {
        while let Some(Newest { page, place }) = self.newest() {
            if let Some(record) = record_at::<B>(flash.page(page), place.offset) {
                let (settings, rejected) = Settings::load(record.pairs());
                return Loaded {
                    settings,
                    invalid: false,
                    rejected,
                };
            }
            // The record has no seal, and after a power cut its cells may read differently from a moment ago.
            self.survey_mut(page).newest = None;
        }
        Loaded {
            settings: Settings::defaults(),
            invalid: self.first.written || self.second.written,
            rejected: 0,
        }
    }

    /// Returns the record with the stored outputs. Call [`Self::load`] before: a start uses the outputs of the settings
    /// that it returns.
    #[must_use]
    pub fn outputs<'a>(&self, flash: &'a impl Pages) -> Option<Record<'a>> {
        let (page, offset) = self.newest_outputs()?;
        record_at::<B>(flash.page(page), offset)
    }

    /// Prepares the pages for saves. Call this at every start, before the line is served: it may take 120 ms for
    /// two erases and the programming of a record, on clones of the part 840. Does nothing when nothing was saved since
    /// the last start.
    ///
    /// # Errors
    ///
    /// When the flash fails. The stored configuration is still valid, and later saves are still tried.
    // Not inlined into init, whose frame is too large for short instructions.
    #[inline(never)]
    pub fn prepare<F: Pages>(&mut self, flash: &mut F) -> Result<(), WriteError<F::Error>> {
        // Use the survey that selected the configuration in force. A second survey could find another record,
        // because a seal whose programming was interrupted may read differently every time.
        let sealed = self.seal_again(flash);
        // When a seal is worn out, move the record, as from any page that cannot take more records.
        if let Err(WriteError::Flash(..)) = sealed {
            return sealed;
        }
        let result = match self.newest() {
            Some(newest) => self.make_room(newest, flash),
            None if self.first.written || self.second.written => self.make_one_ready(flash),
            None => self.begin(flash),
        };
        self.survey_again(flash);
        result
    }

    /// Returns whether the page without the newest record is erased, so that a save finds room there. Also returns
    /// true while no record is valid, because then no page may be erased.
    #[must_use]
    pub fn has_spare(&self) -> bool {
        self.newest()
            .is_none_or(|newest| self.survey(newest.page.other()).is_ready())
    }

    /// Erases the page without the newest record, unless [`Self::has_spare`]. This stops the program for up to 40
    /// ms, on clones of the part 400.
    ///
    /// # Errors
    ///
    /// When the flash fails. The stored configuration is still valid.
    pub fn make_spare<F: Pages>(&mut self, flash: &mut F) -> Result<(), WriteError<F::Error>> {
        let result = match self.newest() {
            Some(newest) => self.make_ready(newest.page.other(), flash),
            None => Ok(()),
        };
        self.survey_again(flash);
        result
    }

    /// Programs the seals of the newest record again when the power was cut between them, because the first one may
    /// not read the same every time.
    fn seal_again<F: Pages>(&self, flash: &mut F) -> Result<(), WriteError<F::Error>> {
        let Some(Newest { page, place }) = self.newest().filter(|newest| newest.place.sealed == 1)
        else {
            return Ok(());
        };
        let mut seals = [place.seals, place.seals.saturating_add(2)].into_iter();
        perform_all(flash, &mut || {
            // 0 can be programmed over any value.
            let (offset, half) = (seals.next()?, 0);
            Some(Operation::Program { page, offset, half })
        })
    }

    /// Clears the page without the newest record, and moves the newest record there if its own page has little room
    /// left.
    fn make_room<F: Pages>(
        &self,
        newest: Newest,
        flash: &mut F,
    ) -> Result<(), WriteError<F::Error>> {
        let Newest { page, place } = newest;
        let to = page.other();
        self.make_ready(to, flash)?;
        let survey = self.survey(page);
        if survey.clean && (!survey.has_old_records() || survey.room() >= LITTLE_ROOM) {
            return Ok(());
        }
        let Some(record) = record_at::<B>(flash.page(page), place.offset) else {
            return Ok(());
        };
        let mut settings = Copied::settings::<B>(&record, page, place.offset);
        let mut outputs = self.stored_outputs(flash);
        let count = outputs.iter().fold(settings.count(), |count, outputs| {
            count.saturating_add(outputs.count())
        });
        let sequence = place.sequence.wrapping_add(1);
        let encoder = Encoder::new(record.schema, sequence, count);
        // Version 0.1 wrote records without seals, so its longest record does not fit with seals.
        if encoder.size() > flash.page(to).len().saturating_sub(FIRST_OFFSET) {
            return Ok(());
        }
        let mut writing = Writing::new(to, FIRST_OFFSET, encoder);
        while let Some(operation) = writing.next(&mut || {
            let mut outputs = outputs.iter_mut();
            settings.next(flash).or_else(|| outputs.next()?.next(flash))
        }) {
            operation.perform(flash)?;
        }
        self.make_ready(page, flash)
    }

    /// Prepares one page when something was stored but no record is valid. The other page is left unchanged.
    fn make_one_ready<F: Pages>(&self, flash: &mut F) -> Result<(), WriteError<F::Error>> {
        if self.first.is_ready() || self.second.is_ready() {
            return Ok(());
        }
        self.make_ready(self.least_wanted(), flash)
    }

    /// Stores a first record when nothing was ever stored, so that there is a valid record even after a power cut
    /// in the first save. It uses a page that needs no erase, so that a power cut here leaves nothing that looks
    /// like a damaged configuration. Exception: when only the first page is blank, an erase may have been
    /// interrupted here before, so the page must be erased again before it is programmed.
    fn begin<F: Pages>(&self, flash: &mut F) -> Result<(), WriteError<F::Error>> {
        let page = if self.first.blank || self.first.is_ready() || !self.second.blank {
            Page::First
        } else {
            Page::Second
        };
        let as_delivered = self.survey(page).blank && (page == Page::Second || self.second.blank);
        if as_delivered {
            let mut marking = Readying::Mark(page);
            perform_all(flash, &mut || marking.next())?;
        } else {
            self.make_ready(page, flash)?;
        }
        let mut writing = Writing::new(page, FIRST_OFFSET, Encoder::new(SCHEMA, 0, 0));
        perform_all(flash, &mut || writing.next(&mut || None))?;
        self.make_ready(page.other(), flash)
    }

    fn make_ready<F: Pages>(&self, page: Page, flash: &mut F) -> Result<(), WriteError<F::Error>> {
        let survey = self.survey(page);
        if survey.is_ready() {
            return Ok(());
        }
        let mut readying = Readying::new(page, survey.marked);
        perform_all(flash, &mut || readying.next())
    }

    fn survey_again(&mut self, flash: &impl Pages) {
        *self = Self::open(flash);
    }

    /// Excludes a page that has failed from further records, until the next start.
    const fn avoid(&mut self, page: Page) {
        self.survey_mut(page).clean = false;
    }

    fn newest(&self) -> Option<Newest> {
        let on = |page: Page| {
            let place = self.survey(page).newest?;
            Some(Newest { page, place })
        };
        match (on(Page::First), on(Page::Second)) {
            (Some(first), Some(second)) if second.place.counts_before(&first.place) => Some(second),
            (None, second) => second,
            (first, _) => first,
        }
    }

    /// Returns the stored outputs, to be copied.
    fn stored_outputs(&self, flash: &impl Pages) -> Each<B::Kept, Copied> {
        Each::of(|_| {
            if let Some((page, offset)) = self.newest_outputs()
                && let Some(record) = record_at::<B>(flash.page(page), offset)
            {
                Copied::outputs::<B>(&record, page, offset)
            } else {
                Copied::NOTHING
            }
        })
    }

    /// Returns page and offset of the record with the stored outputs.
    fn newest_outputs(&self) -> Option<(Page, usize)> {
        let Newest { page, place } = self.newest()?;
        Some((page, self.survey(page).outputs.unwrap_or(place.offset)))
    }

    const fn survey(&self, page: Page) -> &Survey {
        match page {
            Page::First => &self.first,
            Page::Second => &self.second,
        }
    }

    const fn survey_mut(&mut self, page: Page) -> &mut Survey {
        match page {
            Page::First => &mut self.first,
            Page::Second => &mut self.second,
        }
    }

    /// Returns the page to erase when there is no valid record: the page that is less useful for a diagnosis.
    const fn least_wanted(&self) -> Page {
        if self.first.written {
            Page::Second
        } else {
            Page::First
        }
    }
}

/// Performs operations until there are no more.
fn perform_all<F: Pages>(
    flash: &mut F,
    next: &mut dyn FnMut() -> Option<Operation>,
) -> Result<(), WriteError<F::Error>> {
    while let Some(operation) = next() {
        operation.perform(flash)?;
    }
    Ok(())
}
