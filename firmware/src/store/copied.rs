//! Pairs that a new record copies from the stored ones.

use register_map::board::Board;
use register_map::points;
use register_map::record::{OUTPUTS, Record, pair_of};

use super::{Page, Pages};

/// Pairs of a record. They are copied unchanged: the next start may run a newer firmware, which knows all of their values.
#[derive(Clone, Copy, Debug)]
pub(super) struct Copied {
    page: Page,
    /// Offset of the record.
    offset: usize,
    /// Index of the next pair, and of the end.
    next: usize,
    end: usize,
}

impl Copied {
    /// No pairs.
    pub(super) const NOTHING: Self = Self {
        page: Page::First,
        offset: 0,
        next: 0,
        end: 0,
    };

    /// Returns the settings of a record at this place.
    pub(super) fn settings<B: Board>(record: &Record<'_>, page: Page, offset: usize) -> Self {
        Self {
            page,
            offset,
            next: 0,
            end: settings_of::<B>(record),
        }
    }

    /// Returns the outputs of a record at this place, at most as many as fit into a page with the largest settings.
    pub(super) fn outputs<B: Board>(record: &Record<'_>, page: Page, offset: usize) -> Self {
        let settings = settings_of::<B>(record);
        let outputs = record.count().saturating_sub(settings);
        Self {
            page,
            offset,
            next: settings,
            end: settings.saturating_add(outputs.min(usize::from(points::COUNT))),
        }
    }

    /// Returns the number of pairs that are left.
    pub(super) fn count(&self) -> u16 {
        // Of a record, which has at most 65,535.
        self.end.saturating_sub(self.next) as u16
    }

    /// Returns the next pair.
    pub(super) fn next(&mut self, flash: &impl Pages) -> Option<(u16, u16)> {
        if self.next >= self.end {
            return None;
        }
        let pair = pair_of(flash.page(self.page).get(self.offset..)?, self.next);
        self.next = self.next.saturating_add(1);
        pair
    }
}

/// Returns the number of pairs of settings in a record, which are in front of those of outputs.
fn settings_of<B: Board>(record: &Record<'_>) -> usize {
    if B::ROW.keeps_outputs {
        record.pairs().filter(is_setting::<B>).count()
    } else {
        record.count()
    }
}

/// Returns whether a pair is that of a setting.
pub(super) const fn is_setting<B: Board>((address, _): &(u16, u16)) -> bool {
    !B::ROW.keeps_outputs || *address < OUTPUTS
}
