//! The configuration store: two flash pages, so that the last good configuration is never at risk.
//!
//! [`register_map::record`] has the layout. Records go one behind the other onto the *active* page; the
//! newest good one counts. When the page is full the next record goes to the other, which is kept
//! erased: by [`Store::prepare`] at the start, before the line is served, and by [`Store::make_spare`]
//! after every change of pages, when the caller can stand still. So a save never erases in normal use,
//! and never holds up the line for longer than a half-word takes.
//!
//! ```text
//!   active page                       other page
//!   +------+---+---+-----+--------+   +------+---------------------------+
//!   | mark | 1 | 2 | 3   | erased |   | mark | erased                    |   in use: 3 counts
//!   +------+---+---+-----+--------+   +------+---------------------------+
//!   | mark | 1 | 2 | 3   | 4 |    |   | mark | erased                    |   a save that fits
//!   | mark | 1 | 2 | 3   | 4 |    |   | mark | 5 |                       |   one that does not
//!   | mark | erased               |   | mark | 5 |                       |   `make_spare`, or a start
//!   +------+----------------------+   +------+---+-----------------------+
//! ```
//!
//! Why a power cut does no harm, at whatever operation:
//!
//! - A record counts once its first seal is programmed, after its CRC is complete. Until then the one before
//!   counts, and nothing is erased that holds the newest. So a CRC whose cells read differently from start to
//!   start decides nothing.
//! - A start that finds one seal programs both again. The first one reads the same from then on.
//! - Behind what a cut left over nothing is written: the next start moves the newest record to the
//!   other page (*compaction*) and erases this one.
//! - A page is used only with its mark. The mark is destroyed before an erase and programmed after it,
//!   so a page that was erased half, and may read as erased, is not taken for one that was.
//! - A device that never stored anything begins with a record of defaults, so that there is a good one
//!   before the first save, too.
//! - Where something was stored but nothing good is found, the defaults hold and that is reported, at
//!   every start until something is saved: a page is left as it was found as evidence.

mod flash;
mod operation;
mod saving;
mod survey;

use register_map::Board;
use register_map::record::{Encoder, FIRST_OFFSET, SCHEMA, pair_of};

use crate::config::Settings;
pub use flash::{Flash, Page, StoreError};
pub use operation::Operation;
use operation::{Readying, Writing};
pub use saving::{Progress, Saving};
use survey::{Found, Survey, record_at};

/// With less room than this behind the newest record, and older ones before it, a start makes room.
const LITTLE_ROOM: usize = 256;

/// What a start found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loaded {
    /// The stored settings, or the defaults.
    pub settings: Settings,
    /// Something was stored but nothing good: these are the defaults.
    pub invalid: bool,
    /// So many stored values are not allowed (any more) and have their defaults instead.
    pub rejected: u16,
}

/// The good record that counts.
#[derive(Clone, Copy, Debug)]
struct Newest {
    page: Page,
    found: Found,
}

/// Where things are on the two pages.
#[derive(Clone, Debug)]
pub struct Store {
    first: Survey,
    second: Survey,
}

impl Store {
    /// Looks through both pages.
    #[must_use]
    pub fn open(flash: &impl Flash) -> Self {
        Self {
            first: Survey::of(flash.page(Page::First)),
            second: Survey::of(flash.page(Page::Second)),
        }
    }

    /// The stored configuration, as far as this board allows it. [`Self::prepare`] goes by the same record.
    #[must_use]
    pub fn load(&mut self, board: &Board, flash: &impl Flash) -> Loaded {
        while let Some(Newest { page, found }) = self.newest() {
            if let Some(record) = record_at(flash.page(page), found.offset) {
                let (settings, rejected) = Settings::load(board, record.pairs());
                return Loaded {
                    settings,
                    invalid: false,
                    rejected,
                };
            }
            // It has no seal, and cells of it that a power cut left do not read as they did a moment ago.
            self.survey_mut(page).newest = None;
        }
        Loaded {
            settings: Settings::defaults(),
            invalid: self.first.written || self.second.written,
            rejected: 0,
        }
    }

    /// Makes the pages ready for saves: to be called at every start, before the line is served, for it
    /// may take two erases and the programming of a record, 120 ms in all. Does nothing when nothing
    /// was saved since the last start.
    ///
    /// # Errors
    ///
    /// When the flash fails. What is stored is still good, and saves are still tried.
    pub fn prepare<F: Flash>(&mut self, flash: &mut F) -> Result<(), StoreError<F::Error>> {
        // The survey that decided what is in force decides here, too. A second look could find another record: a seal
        // whose program was cut off may read differently every time.
        let sealed = self.seal_again(flash);
        // Where a seal is worn out, the record is moved, as from any page that takes no more.
        if let Err(StoreError::Flash(..)) = sealed {
            return sealed;
        }
        let result = match self.newest() {
            Some(newest) => self.make_room(newest, flash),
            None if self.first.written || self.second.written => self.make_one_ready(flash),
            None => self.begin(flash),
        };
        self.look_again(flash);
        result
    }

    /// Whether the page without the newest record is erased, so that a save finds room there. True as
    /// well while nothing good is stored: then no page may be given up.
    #[must_use]
    pub fn has_spare(&self) -> bool {
        self.newest()
            .is_none_or(|newest| self.survey(newest.page.other()).is_ready())
    }

    /// Erases the page without the newest record, unless [`Self::has_spare`]. The erase holds the
    /// program up for up to 40 ms.
    ///
    /// # Errors
    ///
    /// When the flash fails. What is stored is still good.
    pub fn make_spare<F: Flash>(&mut self, flash: &mut F) -> Result<(), StoreError<F::Error>> {
        let result = match self.newest() {
            Some(newest) => self.make_ready(newest.page.other(), flash),
            None => Ok(()),
        };
        self.look_again(flash);
        result
    }

    /// Programs the seals of the newest record again when the power was cut between them: the first one may
    /// not be steady.
    fn seal_again<F: Flash>(&self, flash: &mut F) -> Result<(), StoreError<F::Error>> {
        let Some(Newest { page, found }) = self.newest().filter(|newest| newest.found.sealed == 1)
        else {
            return Ok(());
        };
        for offset in [found.seals, found.seals.saturating_add(2)] {
            // Zero may be programmed over anything.
            Operation::Program {
                page,
                offset,
                half: 0,
            }
            .perform(flash)?;
        }
        Ok(())
    }

    /// Clears the page without the newest record, and moves that there if the other cannot take many
    /// more.
    fn make_room<F: Flash>(
        &self,
        newest: Newest,
        flash: &mut F,
    ) -> Result<(), StoreError<F::Error>> {
        let Newest { page, found } = newest;
        let offset = found.offset;
        let to = page.other();
        self.make_ready(to, flash)?;
        let survey = self.survey(page);
        if survey.clean && (survey.records < 2 || survey.room() >= LITTLE_ROOM) {
            return Ok(());
        }
        let Some(record) = record_at(flash.page(page), offset) else {
            return Ok(());
        };
        // As it is: the next start may find a newer firmware, which knows all of it.
        let count = u16::try_from(record.count()).unwrap_or(u16::MAX);
        let sequence = found.sequence.wrapping_add(1);
        let encoder = Encoder::new(record.schema, sequence, count);
        // Version 0.1 left no room for seals.
        if encoder.size() > flash.page(to).len().saturating_sub(FIRST_OFFSET) {
            return Ok(());
        }
        let mut writing = Writing::new(to, FIRST_OFFSET, encoder);
        let mut index: usize = 0;
        while let Some(operation) = writing.next(&mut || {
            let bytes = flash.page(page).get(offset..)?;
            let pair = pair_of(bytes, index);
            index = index.saturating_add(1);
            pair
        }) {
            operation.perform(flash)?;
        }
        self.make_ready(page, flash)
    }

    /// Something was stored, but nothing good: one page is made ready, the other left as it is.
    fn make_one_ready<F: Flash>(&self, flash: &mut F) -> Result<(), StoreError<F::Error>> {
        if self.first.is_ready() || self.second.is_ready() {
            return Ok(());
        }
        self.make_ready(self.least_wanted(), flash)
    }

    /// Nothing was ever stored: from now on there is always a good record, so that a cut in the very
    /// first save finds one, too. It goes where nothing need be erased for it, so that a cut meanwhile
    /// leaves nothing that looks like a damaged configuration. But the first page, when it alone is
    /// blank, may be so from an erase that was cut short here, and must not be programmed then.
    fn begin<F: Flash>(&self, flash: &mut F) -> Result<(), StoreError<F::Error>> {
        let page = if self.first.blank || self.first.is_ready() || !self.second.blank {
            Page::First
        } else {
            Page::Second
        };
        let as_delivered = self.survey(page).blank && (page == Page::Second || self.second.blank);
        if as_delivered {
            let mut marking = Readying::Mark(page);
            while let Some(operation) = marking.next() {
                operation.perform(flash)?;
            }
        } else {
            self.make_ready(page, flash)?;
        }
        let mut writing = Writing::new(page, FIRST_OFFSET, Encoder::new(SCHEMA, 0, 0));
        while let Some(operation) = writing.next(&mut || None) {
            operation.perform(flash)?;
        }
        self.make_ready(page.other(), flash)
    }

    fn make_ready<F: Flash>(&self, page: Page, flash: &mut F) -> Result<(), StoreError<F::Error>> {
        let survey = self.survey(page);
        if survey.is_ready() {
            return Ok(());
        }
        let mut readying = Readying::new(page, survey.marked);
        while let Some(operation) = readying.next() {
            operation.perform(flash)?;
        }
        Ok(())
    }

    fn look_again(&mut self, flash: &impl Flash) {
        *self = Self::open(flash);
    }

    /// Keeps records off a page that has failed, until the next start.
    const fn avoid(&mut self, page: Page) {
        self.survey_mut(page).clean = false;
    }

    fn newest(&self) -> Option<Newest> {
        let on = |page: Page| {
            let found = self.survey(page).newest?;
            Some(Newest { page, found })
        };
        match (on(Page::First), on(Page::Second)) {
            (Some(first), Some(second)) if second.found.counts_before(&first.found) => Some(second),
            (None, second) => second,
            (first, _) => first,
        }
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

    /// Where there is no good record: the page whose content is missed least.
    const fn least_wanted(&self) -> Page {
        if self.first.written {
            Page::Second
        } else {
            Page::First
        }
    }
}
