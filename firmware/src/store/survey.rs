//! The content of a page.

use register_map::board::Board;
use register_map::record::{
    FIRST_OFFSET, PAGE_MARK, Record, SEALS, is_newer, is_vacant, records, used,
};

/// The place of a valid record on its page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Offset of the record, in bytes.
    pub(super) offset: usize,
    /// Offset of its seals, in bytes.
    pub(super) seals: usize,
    pub(super) sequence: u32,
    /// Number of complete seals, counted from the first: 0 to 2.
    pub(super) sealed: u8,
}

impl Place {
    fn new(page: &[u8], offset: usize, record: Record<'_>) -> Self {
        let seals = offset.saturating_add(record.size());
        let sealed = match page.get(seals..).and_then(<[u8]>::first_chunk) {
            Some([0, 0, 0, 0]) => 2,
            Some([0, 0, ..]) => 1,
            _ => 0,
        };
        Self {
            offset,
            seals,
            sequence: record.sequence,
            sealed,
        }
    }

    /// Returns whether this record counts rather than the other one. A sealed record counts before any unsealed
    /// one, because the CRC of an unsealed record may read differently every time.
    pub(super) const fn counts_before(&self, other: &Self) -> bool {
        match (self.sealed > 0, other.sealed > 0) {
            (true, false) => true,
            (false, true) => false,
            _ => is_newer(self.sequence, other.sequence),
        }
    }
}

/// A summary of a page's bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Survey {
    /// The valid record of settings that counts.
    pub(super) newest: Option<Place>,
    /// Offset of the valid record of outputs alone that replaces its outputs.
    pub(super) outputs: Option<usize>,
    /// The page was erased completely, and the area after its sealed records is still erased.
    pub(super) clean: bool,
    /// The page has the mark of a complete erase.
    pub(super) marked: bool,
    /// Every byte reads as erased, including the place of the mark.
    pub(super) blank: bool,
    /// Something was stored on the page, valid or not: it is not [`is_vacant`].
    pub(super) written: bool,
    /// Offset of the next record on a clean page.
    pub(super) end: usize,
    /// Bytes of the page.
    size: usize,
    /// Number of valid records.
    pub(super) records: usize,
}

impl Survey {
    pub(super) fn of<B: Board>(page: &[u8]) -> Self {
        let used = used(page);
        let marked = page.first_chunk() == Some(&PAGE_MARK.to_le_bytes());
        let mut survey = Self {
            newest: None,
            outputs: None,
            clean: marked,
            marked,
            blank: used == 0,
            written: !is_vacant(page.get(..used).unwrap_or_default()),
            end: FIRST_OFFSET,
            size: page.len(),
            records: 0,
        };
        for (offset, record) in records(page, B::ROW) {
            let place = Place::new(page, offset, record);
            survey.clean &= offset == survey.end && place.sealed == 2;
            survey.end = place.seals.saturating_add(SEALS);
            survey.records = survey.records.saturating_add(1);
            if B::ROW.keeps_outputs && record.holds_outputs() {
                // Without a seal, its CRC may read differently at the next start.
                if place.sealed > 0 {
                    survey.outputs = Some(offset);
                }
            } else if survey
                .newest
                .is_none_or(|newest| place.counts_before(&newest))
            {
                survey.newest = Some(place);
                survey.outputs = None;
            }
        }
        survey.clean &= used <= survey.end;
        survey
    }

    /// Returns whether the page was erased completely and nothing was written since.
    pub(super) const fn is_ready(&self) -> bool {
        self.clean && self.records == 0
    }

    /// Returns whether the page has valid records that do not count.
    pub(super) const fn has_old_records(&self) -> bool {
        self.records > 1 + self.outputs.is_some() as usize
    }

    /// Returns the free bytes of a clean page, or 0 for any other page.
    pub(super) const fn room(&self) -> usize {
        if self.clean {
            self.size.saturating_sub(self.end)
        } else {
            0
        }
    }
}

/// Returns the record at an offset of a page, if it is valid.
pub(super) fn record_at<B: Board>(page: &[u8], offset: usize) -> Option<Record<'_>> {
    Record::decode(page.get(offset..)?, B::ROW)
}

#[cfg(test)]
mod tests {
    use super::*;
    use register_map::board::Modio08;
    use register_map::record::encode_page;

    const PAGE_SIZE: usize = 1024;

    fn page(bytes: &[u8]) -> [u8; PAGE_SIZE] {
        let mut page = [0xFF; PAGE_SIZE];
        page[..bytes.len()].copy_from_slice(bytes);
        page
    }

    #[test]
    fn a_page_is_ready_only_with_its_mark_and_without_other_content() {
        let mark = PAGE_MARK.to_le_bytes();
        let ready = Survey::of::<Modio08>(&page(&mark));
        assert!(ready.is_ready() && !ready.written);
        assert_eq!((ready.end, ready.room()), (2, PAGE_SIZE - 2));
        let erased = Survey::of::<Modio08>(&page(&[]));
        assert!(
            !erased.is_ready() && !erased.written,
            "without a mark the erase may have been incomplete"
        );
        let half_marked = Survey::of::<Modio08>(&page(&[mark[0], 0xFF]));
        assert!(!half_marked.is_ready() && !half_marked.written);
        let mut last = page(&mark);
        last[PAGE_SIZE - 1] = 0xFE;
        let spoilt = Survey::of::<Modio08>(&last);
        assert!(!spoilt.is_ready() && spoilt.written && spoilt.room() == 0);
    }

    /// Returns a page with a record for each of these sequence numbers, in whose seals the first `unsealed` bytes
    /// are still erased.
    fn records_of(sequences: &[u32], unsealed: usize) -> [u8; PAGE_SIZE] {
        let mut bytes = page(&PAGE_MARK.to_le_bytes());
        let mut end = FIRST_OFFSET;
        for sequence in sequences {
            let mut other = [0xFF; PAGE_SIZE];
            let size = encode_page(*sequence, &[], &mut other).unwrap() - FIRST_OFFSET;
            bytes[end..end + size].copy_from_slice(&other[FIRST_OFFSET..][..size]);
            end += size;
        }
        bytes[end - unsealed..end].fill(0xFF);
        bytes
    }

    #[test]
    fn unsealed_record_counts_only_when_no_record_is_sealed() {
        let newest = |bytes: [u8; PAGE_SIZE]| {
            Survey::of::<Modio08>(&bytes)
                .newest
                .map(|place| (place.sequence, place.sealed))
        };
        assert_eq!(newest(records_of(&[1, 2], 0)), Some((2, 2)));
        assert_eq!(newest(records_of(&[1, 2], 2)), Some((2, 1)));
        assert_eq!(newest(records_of(&[1, 2], 4)), Some((1, 2)));
        assert_eq!(newest(records_of(&[2], 4)), Some((2, 0)));
    }

    #[test]
    fn no_record_is_added_to_a_page_with_an_incomplete_seal() {
        for unsealed in [0, 2, 4] {
            let survey = Survey::of::<Modio08>(&records_of(&[1, 2], unsealed));
            assert_eq!(survey.clean, unsealed == 0, "{unsealed}");
            assert_eq!((survey.end, survey.records), (2 + 2 * 18, 2));
        }
    }

    #[test]
    fn no_record_is_added_to_a_page_with_data_after_its_records() {
        let mut bytes = page(&[]);
        let size = encode_page(0, &[(0x0114, 1)], &mut bytes).unwrap();
        assert!(Survey::of::<Modio08>(&bytes).clean);
        bytes[size + 10] = 0;
        let survey = Survey::of::<Modio08>(&bytes);
        assert!(!survey.clean && survey.newest.map(|place| place.offset) == Some(2));
    }

    #[test]
    fn the_newest_record_counts_at_any_place_and_across_the_wrap() {
        let mut bytes = page(&[]);
        encode_page(0, &[(0x0114, 1)], &mut bytes).unwrap();
        let mut put = |offset: usize, sequence| {
            let mut other = [0xFF; PAGE_SIZE];
            let size = encode_page(sequence, &[], &mut other).unwrap() - 2;
            bytes[offset..offset + size].copy_from_slice(&other[2..2 + size]);
        };
        put(100, u32::MAX);
        put(200, 1);
        put(300, 0);
        let survey = Survey::of::<Modio08>(&bytes);
        let newest = survey.newest.map(|place| (place.offset, place.sequence));
        assert_eq!((newest, survey.records), (Some((200, 1)), 4));
    }
}
