//! What is on a page.

use register_map::record::{
    FIRST_OFFSET, PAGE_MARK, PAGE_SIZE, Record, is_newer, is_vacant, records,
};

/// What the bytes of a page amount to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Survey {
    /// Offset and sequence number of the newest good record.
    pub(super) newest: Option<(usize, u32)>,
    /// The page was erased completely, and behind its good records, if any, it still is.
    pub(super) clean: bool,
    /// It has the mark of a complete erase.
    pub(super) marked: bool,
    /// All of it reads as erased, the place of the mark, too.
    pub(super) blank: bool,
    /// Something was stored there, be it good or not: it is not [`is_vacant`].
    pub(super) written: bool,
    /// Where the next record goes on a clean page.
    pub(super) end: usize,
    /// Good records.
    pub(super) records: usize,
}

impl Survey {
    pub(super) fn of(page: &[u8; PAGE_SIZE]) -> Self {
        let marked = page.first_chunk() == Some(&PAGE_MARK.to_le_bytes());
        let mut survey = Self {
            newest: None,
            clean: marked,
            marked,
            blank: page.iter().all(|byte| *byte == 0xFF),
            written: !is_vacant(page),
            end: FIRST_OFFSET,
            records: 0,
        };
        for (offset, record) in records(page) {
            survey.clean &= offset == survey.end;
            survey.end = offset.saturating_add(record.size());
            survey.records = survey.records.saturating_add(1);
            if survey
                .newest
                .is_none_or(|(_, newest)| is_newer(record.sequence, newest))
            {
                survey.newest = Some((offset, record.sequence));
            }
        }
        let behind = page.get(survey.end..).unwrap_or_default();
        survey.clean &= behind.iter().all(|byte| *byte == 0xFF);
        survey
    }

    /// Erased completely and nothing written since.
    pub(super) const fn is_ready(&self) -> bool {
        self.clean && self.records == 0
    }

    /// Bytes free on a clean page.
    pub(super) const fn room(&self) -> usize {
        if self.clean {
            PAGE_SIZE.saturating_sub(self.end)
        } else {
            0
        }
    }
}

/// The record at an offset of a page.
pub(super) fn record_at(page: &[u8; PAGE_SIZE], offset: usize) -> Option<Record<'_>> {
    Record::decode(page.get(offset..)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use register_map::Module;
    use register_map::record::{encode_page, module_in_slot};

    fn page(bytes: &[u8]) -> [u8; PAGE_SIZE] {
        let mut page = [0xFF; PAGE_SIZE];
        page[..bytes.len()].copy_from_slice(bytes);
        page
    }

    #[test]
    fn a_page_is_ready_only_with_its_mark_and_nothing_else() {
        let mark = PAGE_MARK.to_le_bytes();
        let ready = Survey::of(&page(&mark));
        assert!(ready.is_ready() && !ready.written);
        assert_eq!((ready.end, ready.room()), (2, PAGE_SIZE - 2));
        let erased = Survey::of(&page(&[]));
        assert!(
            !erased.is_ready() && !erased.written,
            "without a mark it may be weak"
        );
        let half_marked = Survey::of(&page(&[mark[0], 0xFF]));
        assert!(!half_marked.is_ready() && !half_marked.written);
        let mut last = page(&mark);
        last[PAGE_SIZE - 1] = 0xFE;
        let spoilt = Survey::of(&last);
        assert!(!spoilt.is_ready() && spoilt.written && spoilt.room() == 0);
    }

    #[test]
    fn the_next_record_goes_behind_the_last_even_if_that_ends_as_erased_flash_does() {
        // A record whose CRC ends in FF FF: found by trying sequence numbers.
        let mut bytes = [0xFF; PAGE_SIZE];
        let size = (0..).find_map(|sequence| {
            let size = encode_page(sequence, &[], &mut bytes)?;
            bytes[..size].ends_with(&[0xFF, 0xFF]).then_some(size)
        });
        let survey = Survey::of(&bytes);
        assert_eq!(
            (Some(survey.end), survey.clean, survey.records),
            (size, true, 1)
        );
    }

    #[test]
    fn a_page_with_something_behind_its_records_takes_no_more() {
        let preset = module_in_slot(Module::Di4);
        let mut bytes = page(&preset);
        assert!(Survey::of(&bytes).clean);
        bytes[preset.len() + 10] = 0;
        let survey = Survey::of(&bytes);
        assert!(!survey.clean && survey.newest == Some((2, 0)));
    }

    #[test]
    fn the_newest_counts_wherever_it_stands_and_across_the_wrap() {
        let mut bytes = page(&module_in_slot(Module::Di4));
        let mut put = |offset: usize, sequence| {
            let mut other = [0xFF; PAGE_SIZE];
            let size = encode_page(sequence, &[], &mut other).unwrap() - 2;
            bytes[offset..offset + size].copy_from_slice(&other[2..2 + size]);
        };
        put(100, u32::MAX);
        put(200, 1);
        put(300, 0);
        let survey = Survey::of(&bytes);
        assert_eq!((survey.newest, survey.records), (Some((200, 1)), 4));
    }
}
