//! Pairs that a new record copies from the stored ones.

use core::ops::Range;

use register_map::points;
use register_map::record::{OUTPUTS, Record, pair_of};

use super::{Page, Pages};
use crate::KEEPS_OUTPUTS;

/// Pairs of a record. They are copied unchanged: the next start may run a newer firmware, which knows all of their values.
#[derive(Clone, Debug)]
pub(super) struct Copied {
    page: Page,
    /// Offset of the record.
    offset: usize,
    indices: Range<usize>,
}

/// Number of copies of outputs: none on a device that does not keep outputs, so that nothing of them is in its image.
pub(super) const OF_OUTPUTS: usize = KEEPS_OUTPUTS as usize;

impl Copied {
    /// No pairs.
    pub(super) const NOTHING: Self = Self {
        page: Page::First,
        offset: 0,
        indices: 0..0,
    };

    /// Returns the settings of a record at this place.
    pub(super) fn settings(record: &Record<'_>, page: Page, offset: usize) -> Self {
        Self {
            page,
            offset,
            indices: 0..settings_of(record),
        }
    }

    /// Returns the outputs of a record at this place, at most as many as fit into a page with the largest settings.
    pub(super) fn outputs(record: &Record<'_>, page: Page, offset: usize) -> Self {
        let settings = settings_of(record);
        let outputs = record.count().saturating_sub(settings);
        Self {
            page,
            offset,
            indices: settings..settings.saturating_add(outputs.min(usize::from(points::COUNT))),
        }
    }

    /// Returns the number of pairs that are left.
    pub(super) fn count(&self) -> u16 {
        // Of a record, which has at most 65,535.
        self.indices.len() as u16
    }

    /// Returns the next pair.
    pub(super) fn next(&mut self, flash: &impl Pages) -> Option<(u16, u16)> {
        let index = self.indices.next()?;
        pair_of(flash.page(self.page).get(self.offset..)?, index)
    }
}

/// Returns the number of pairs of settings in a record, which are in front of those of outputs.
fn settings_of(record: &Record<'_>) -> usize {
    if KEEPS_OUTPUTS {
        record.pairs().filter(is_setting).count()
    } else {
        record.count()
    }
}

/// Returns whether a pair is that of a setting.
pub(super) const fn is_setting((address, _): &(u16, u16)) -> bool {
    !KEEPS_OUTPUTS || *address < OUTPUTS
}
