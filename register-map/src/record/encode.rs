//! Encoding of records.

use crc::{Digest, NoTable};

use super::{CRC, FIRST_OFFSET, HEAD, MARK, OVERHEAD, PAGE_MARK, SCHEMA, SEALS};

/// Returns a record half-word by half-word, the unit in which this flash is programmed.
#[derive(Clone)]
pub struct Encoder {
    head: [u16; HEAD / 2],
    crc: Digest<'static, u32, NoTable>,
    /// Value of the pair whose address was the last half-word.
    value: Option<u16>,
    /// Number of half-words returned so far.
    at: usize,
    count: u16,
}

impl Encoder {
    /// Creates a record of `count` pairs.
    #[must_use]
    pub fn new(schema: u16, sequence: u32, count: u16) -> Self {
        let [q0, q1, q2, q3] = sequence.to_le_bytes();
        Self {
            head: [
                MARK,
                schema,
                u16::from_le_bytes([q0, q1]),
                u16::from_le_bytes([q2, q3]),
                count,
            ],
            crc: CRC.digest(),
            value: None,
            at: 0,
            count,
        }
    }

    /// Returns the bytes of the whole record with its seals.
    #[must_use]
    pub const fn size(&self) -> usize {
        self.unsealed() + SEALS
    }

    /// Returns the bytes of the record without its seals.
    const fn unsealed(&self) -> usize {
        OVERHEAD + self.count as usize * 4
    }

    /// Returns the next half-word, or `None` after the last. Calls `pair` for each next pair of address and value,
    /// `count` times in total. If `pair` returns none, an unknown address is stored.
    pub fn next(&mut self, pair: &mut dyn FnMut() -> Option<(u16, u16)>) -> Option<u16> {
        let body = self.unsealed().saturating_sub(4) / 2;
        let half = if let Some(half) = self.head.get(self.at) {
            *half
        } else if self.at < body {
            match self.value.take() {
                Some(value) => value,
                None => {
                    let (address, value) = pair().unwrap_or((0xFFFF, 0xFFFF));
                    self.value = Some(value);
                    address
                }
            }
        } else {
            let [c0, c1, c2, c3] = self.crc.clone().finalize().to_le_bytes();
            let half = match self.at.wrapping_sub(body) {
                0 => [c0, c1],
                1 => [c2, c3],
                2 | 3 => [0, 0],
                _ => return None,
            };
            self.at = self.at.saturating_add(1);
            return Some(u16::from_le_bytes(half));
        };
        self.crc.update(&half.to_le_bytes());
        self.at = self.at.saturating_add(1);
        Some(half)
    }
}

impl core::fmt::Debug for Encoder {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Encoder")
            .field("head", &self.head)
            .field("at", &self.at)
            .finish_non_exhaustive()
    }
}

/// Writes a page mark and one record into `page` and returns the number of bytes. Returns `None`, with undefined
/// content in `page`, when there is not enough room. At the start of the store's first page, with the rest erased,
/// these bytes preset a device that has never stored anything: a simulator or a programmer writes them.
pub fn encode_page(sequence: u32, pairs: &[(u16, u16)], page: &mut [u8]) -> Option<usize> {
    let mut encoder = Encoder::new(SCHEMA, sequence, u16::try_from(pairs.len()).ok()?);
    let size = encoder.size().checked_add(FIRST_OFFSET)?;
    let mut pairs = pairs.iter().copied();
    let (halves, _) = page.get_mut(..size)?.as_chunks_mut();
    let (mark, record) = halves.split_first_mut()?;
    *mark = PAGE_MARK.to_le_bytes();
    for place in record {
        *place = encoder.next(&mut || pairs.next())?.to_le_bytes();
    }
    Some(size)
}

/// A sealed record of defaults with sequence number 0: the first record of a device that has never stored anything.
pub const BEGINNING: [u8; OVERHEAD + SEALS] = [
    0x6D, 0x6F, 0x01, 0x01, 0, 0, 0, 0, 0, 0, // head
    0xE9, 0xA2, 0x94, 0x2E, // CRC
    0, 0, 0, 0, // seals
];

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;
    use crate::board::MODIO_08;
    use crate::record::records;
    use crate::{Module, configuration};

    /// Computed by hand, except for the CRC, which is from Python's zlib.crc32.
    const DI4_IN_PORT_5: [u8; 24] = [
        0x6F, 0x6B, // page mark
        0x6D, 0x6F, 0x01, 0x01, 0, 0, 0, 0, 1, 0, // head: schema 0x0101, sequence 0, one pair
        0x14, 0x01, 0x01, 0x00, // 0x0114 = 1
        0x6A, 0x52, 0xCA, 0x95, // CRC
        0, 0, 0, 0, // seals
    ];

    #[test]
    fn the_layout_matches_the_documentation() {
        let mut page = [0xFF; 100];
        assert_eq!(encode_page(0, &[(0x0114, 1)], &mut page), Some(24));
        assert_eq!(page[..24], DI4_IN_PORT_5);
    }

    #[test]
    fn a_preset_is_a_page_with_one_record() {
        let modules = [Module::Di4, Module::None, Module::Ai4, Module::Ao4];
        let mut page = [0xFF; 100];
        let pairs: Vec<_> = configuration::modules((1_u16..).zip(modules)).collect();
        encode_page(0, &pairs, &mut page).unwrap();
        let found: Vec<_> = records(&page, &MODIO_08).collect();
        let [(FIRST_OFFSET, record)] = found[..] else {
            panic!("{found:?}");
        };
        let pairs: Vec<_> = record.pairs().collect();
        assert_eq!(pairs, [(0x0110, 1), (0x0112, 4), (0x0113, 5)]);
    }

    #[test]
    fn a_record_that_does_not_fit_is_not_written() {
        assert_eq!(encode_page(0, &[(1, 1)], &mut [0; 23]), None);
        assert_eq!(encode_page(0, &[], &mut []), None);
    }
}
