//! The format of a stored configuration: two flash pages that hold records.
//!
//! A record holds the settings that differ from their defaults, as pairs of address and value. So it is small, and
//! an address has the same meaning for every firmware that reads it. A setting that is not in the record has its
//! default, and a firmware ignores addresses that it does not know. All numbers are little-endian.
//!
//! ```text
//!  a page            offset   bytes
//!  +---------------+ 0        2      PAGE_MARK, programmed when an erase is complete
//!  | page mark     | 2        ...    records, one after another, oldest first
//!  +---------------+                 0xFF up to the end
//!  | record        |
//!  +---------------+
//!  | newer record  |    a record     offset   bytes
//!  +---------------+    +----------+ 0        2      MARK
//!  | erased: 0xFF  |    | head     | 2        2      schema: high byte layout, low byte register map
//!  |               |    |          | 4        4      sequence number: the newest record counts
//!  +---------------+    |          | 8        2      n, the number of pairs
//!                       +----------+ 10       4 n    n times address and value, two bytes each
//!                       | pairs    |
//!                       +----------+
//!                       | CRC-32   | 10 + 4 n 4      CRC-32/ISO-HDLC over everything before
//!                       +----------+
//!                       | seals    | 14 + 4 n 4      two half-words of 0, programmed after the CRC
//!                       +----------+
//! ```
//!
//! The values of outputs that are to start as they were are pairs, too, after those of the settings. So that a change of
//! them needs few bytes, a record of layout 2 has them alone. It replaces the outputs of the record of settings in front
//! of it; a firmware that does not know layout 2 finds the settings nevertheless. The pairs of outputs:
//!
//! ```text
//!  address, from 0xE000            value
//!  0xE000 + module << 8 + point    word output: raw, 0 to 4095
//!  0xE080 + module << 8 + point    digital outputs of a port, by its first point:
//!                                  bits 0-3 levels, bits 8-11 which outputs are to start as they were
//! ```
//!
//! A record counts once its first seal is programmed. A power cut during the programming of the CRC may leave cells
//! that read differently from read to read, so that the CRC matches at one start and not at the next. The seal is
//! programmed after the CRC is complete, so every cell of a sealed record reads the same every time. A record
//! without seals counts only when no record is sealed: version 0.1 wrote none. A start that finds the second seal
//! missing programs both again, so that the first reads the same every time. A page without its mark was left by an
//! interrupted erase: its cells may read as erased and still be weak, so it is erased again before use.

mod encode;

use crate::board::Row;
use crc::{CRC_32_ISO_HDLC, Crc, NoTable};

pub use encode::{BEGINNING, Encoder, encode_page};

/// First half-word of a page that was erased completely.
pub const PAGE_MARK: u16 = u16::from_le_bytes(*b"ok");

/// Offset of the first record of a page, in bytes.
pub const FIRST_OFFSET: usize = 2;

/// First half-word of a record.
pub const MARK: u16 = u16::from_le_bytes(*b"mo");

/// Schema of the records that this version writes: layout 1, the settings of register map 1.
pub const SCHEMA: u16 = 0x0101;

/// Schema of a record of outputs alone: layout 2.
pub const OUTPUTS_SCHEMA: u16 = 0x0201;

/// First address of the pairs of outputs, which no register has.
pub const OUTPUTS: u16 = 0xE000;

/// Bit of the address of a pair of digital outputs.
pub const BITS: u16 = 0x80;

/// Bytes of a record without its pairs and seals.
pub const OVERHEAD: usize = HEAD + 4;

/// Bytes of the seals after a record.
pub const SEALS: usize = 4;

const HEAD: usize = 10;

/// Without a table: the computation takes 1 to 2 ms at the start, and saves a kilobyte of flash.
static CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// A valid record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Record<'a> {
    /// Layout (high byte; that of [`SCHEMA`] or [`OUTPUTS_SCHEMA`]) and register map (low byte) of the writer.
    pub schema: u16,
    /// Greater than the number of every record of settings written before, except when it wraps.
    pub sequence: u32,
    pairs: &'a [[u8; 4]],
}

impl<'a> Record<'a> {
    /// Returns the record at the start of `bytes`, or `None` when there is none, or it is not valid or has a layout that
    /// is unknown on this board: one that keeps no outputs does not know that of [`OUTPUTS_SCHEMA`].
    #[must_use]
    pub fn decode(bytes: &'a [u8], board: &Row) -> Option<Self> {
        let (head, rest) = bytes.split_first_chunk::<HEAD>()?;
        let [m0, m1, s0, s1, q0, q1, q2, q3, n0, n1] = *head;
        let schema = u16::from_le_bytes([s0, s1]);
        let newest = if board.keeps_outputs { 2 } else { 1 };
        if u16::from_le_bytes([m0, m1]) != MARK || !(1..=newest).contains(&(schema >> 8)) {
            return None;
        }
        let count = usize::from(u16::from_le_bytes([n0, n1]));
        let (body, rest) = rest.split_at_checked(count.checked_mul(4)?)?;
        let stored = u32::from_le_bytes(*rest.first_chunk()?);
        let mut crc = CRC.digest();
        crc.update(head);
        crc.update(body);
        (crc.finalize() == stored).then_some(Self {
            schema,
            sequence: u32::from_le_bytes([q0, q1, q2, q3]),
            pairs: body.as_chunks().0,
        })
    }

    /// Returns whether this is a record of outputs alone.
    #[must_use]
    pub const fn holds_outputs(&self) -> bool {
        self.schema >> 8 == OUTPUTS_SCHEMA >> 8
    }

    /// Returns the bytes of the record without its seals.
    #[must_use]
    pub const fn size(&self) -> usize {
        OVERHEAD + size_of_val(self.pairs)
    }

    /// Returns the number of pairs.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.pairs.len()
    }

    /// Returns one pair of address and value, or `None` after the last.
    #[must_use]
    pub fn pair(&self, index: usize) -> Option<(u16, u16)> {
        self.pairs.get(index).copied().map(pair)
    }

    /// Iterates over every pair of address and value, in the order of the record.
    pub fn pairs(&self) -> impl ExactSizeIterator<Item = (u16, u16)> + Clone + use<'a> {
        self.pairs.iter().copied().map(pair)
    }
}

/// Returns whether a record with the first sequence number was written after one with the second.
#[inline]
#[must_use]
pub const fn is_newer(sequence: u32, than: u32) -> bool {
    let ahead = sequence.wrapping_sub(than);
    ahead != 0 && ahead < 1 << 31
}

/// Returns a pair of the valid record at the start of `bytes`.
#[must_use]
pub fn pair_of(bytes: &[u8], index: usize) -> Option<(u16, u16)> {
    let (pairs, _) = bytes.get(HEAD..)?.as_chunks();
    pairs.get(index).copied().map(pair)
}

fn pair([a0, a1, v0, v1]: [u8; 4]) -> (u16, u16) {
    (u16::from_le_bytes([a0, a1]), u16::from_le_bytes([v0, v1]))
}

/// Returns the number of bytes of a page up to the last one that is not erased.
#[must_use]
pub fn used(page: &[u8]) -> usize {
    let last = page.iter().rposition(|byte| *byte != 0xFF);
    last.map_or(0, |last| last.saturating_add(1))
}

/// Iterates over every valid record of a page with its offset, skipping anything between them.
pub fn records<'a>(page: &'a [u8], board: &Row) -> impl Iterator<Item = (usize, Record<'a>)> {
    let mut offset = 0;
    let end = used(page);
    core::iter::from_fn(move || {
        while offset < end {
            let here = offset;
            let bytes = page.get(offset..)?;
            if let Some(record) = Record::decode(bytes, board) {
                offset = offset.saturating_add(record.size());
                return Some((here, record));
            }
            offset = offset.saturating_add(2);
        }
        None
    })
}

/// Returns whether nothing was ever stored on this page, so that a preset may be written there: it is erased, or
/// contains only its mark and the [`BEGINNING`], complete or interrupted.
#[must_use]
pub fn is_vacant(page: &[u8]) -> bool {
    let content = page.get(FIRST_OFFSET..).unwrap_or_default();
    content.iter().enumerate().all(|(n, byte)| {
        let full = BEGINNING.get(n).unwrap_or(&0xFF);
        // A power cut leaves ones instead of zeros, never the reverse.
        byte & full == *full
    })
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;
    use crate::board::MODIO_08;

    const PAGE_SIZE: usize = 1024;

    fn encoded(sequence: u32, pairs: &[(u16, u16)]) -> Vec<u8> {
        let mut page = [0xFF; PAGE_SIZE];
        let size = encode_page(sequence, pairs, &mut page).unwrap();
        page[FIRST_OFFSET..size - SEALS].to_vec()
    }

    #[test]
    fn an_encoded_record_is_decoded() {
        let pairs = [(0x0101, 1152), (0x01C0, 0xFFFF), (0xFFFF, 0)];
        let bytes = encoded(0xFFFF_FFFF, &pairs);
        let record = Record::decode(&bytes, &MODIO_08).unwrap();
        assert!(record.pairs().eq(pairs));
        assert_eq!(record.pair(1), Some(pairs[1]));
        assert_eq!(record.pair(3), None);
        assert_eq!((record.size(), record.schema), (bytes.len(), SCHEMA));
        assert_eq!(pair_of(&bytes, 2), Some(pairs[2]));
    }

    #[test]
    fn a_record_with_a_wrong_bit_or_missing_byte_is_rejected() {
        let bytes = encoded(7, &[(0x0101, 1152), (0x0141, 0xFFFF)]);
        for bit in 0..bytes.len() * 8 {
            let mut wrong = bytes.clone();
            wrong[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(Record::decode(&wrong, &MODIO_08), None, "bit {bit}");
        }
        for len in 0..bytes.len() {
            assert_eq!(
                Record::decode(&bytes[..len], &MODIO_08),
                None,
                "{len} bytes"
            );
        }
    }

    #[test]
    fn another_layout_is_rejected_and_another_register_map_accepted() {
        let holds_outputs = |schema| {
            let mut encoder = Encoder::new(schema, 0, 0);
            let bytes: Vec<u8> = std::iter::from_fn(|| encoder.next(&mut || None))
                .flat_map(u16::to_le_bytes)
                .collect();
            let record = Record::decode(&bytes, &MODIO_08)?;
            assert_eq!(record.schema, schema);
            Some(record.holds_outputs())
        };
        for (schema, expected) in [
            (SCHEMA, Some(false)),
            (SCHEMA + 1, Some(false)),
            (OUTPUTS_SCHEMA, Some(true)),
            (OUTPUTS_SCHEMA + 1, Some(true)),
            (0x0001, None),
            (0x0301, None),
        ] {
            assert_eq!(holds_outputs(schema), expected, "{schema:#06x}");
        }
    }

    #[test]
    fn the_beginning_is_an_empty_record_on_a_vacant_page() {
        assert_eq!(encoded(0, &[]), BEGINNING[..OVERHEAD]);
        assert!(is_vacant(&[0xFF; PAGE_SIZE]) && is_vacant(&[0; FIRST_OFFSET]));
        let mut page = [0xFF; PAGE_SIZE];
        encode_page(0, &[], &mut page);
        assert!(is_vacant(&page));
        page[5] |= 0xFE;
        assert!(is_vacant(&page), "interrupted");
        page[PAGE_SIZE - 1] = 0xFE;
        assert!(!is_vacant(&page), "a page with garbage is not vacant");
        let mut page = [0xFF; PAGE_SIZE];
        encode_page(1, &[], &mut page);
        assert!(!is_vacant(&page), "defaults that were saved are not vacant");
        let size = encode_page(0, &[(0x0114, 1)], &mut page).unwrap();
        assert!(!is_vacant(&page[..size]));
    }

    #[test]
    fn sequence_numbers_wrap() {
        assert!(is_newer(1, 0) && is_newer(0, u32::MAX) && is_newer(5, u32::MAX - 5));
        assert!(!is_newer(0, 0) && !is_newer(0, 1) && !is_newer(u32::MAX, 0));
    }

    #[test]
    fn a_page_is_used_up_to_its_last_byte_that_is_not_erased() {
        for size in [0, 3, 4, 1024, 1027] {
            let mut page = std::vec![0xFF; size];
            assert_eq!(used(&page), 0);
            for at in [0, 1, 4, 7, 500, 1023, 1024, 1026] {
                if let Some(byte) = page.get_mut(at) {
                    *byte = 0x7F;
                    assert_eq!(used(&page), at + 1, "{at} of {size}");
                }
            }
        }
    }

    #[test]
    fn records_are_found_between_garbage() {
        let (one, two) = (encoded(1, &[(0x0101, 12)]), encoded(2, &[]));
        let page = [
            &[0, 0, 0x6D, 0x6F],
            &one[..],
            &[0x6D, 0x6F],
            &two,
            &one[2..],
        ]
        .concat();
        let found: Vec<_> = records(&page, &MODIO_08)
            .map(|(offset, record)| (offset, record.sequence))
            .collect();
        assert_eq!(found, [(4, 1), (4 + one.len() + 2, 2)]);
        assert_eq!(records(&[0xFF; PAGE_SIZE], &MODIO_08).count(), 0);
    }
}
