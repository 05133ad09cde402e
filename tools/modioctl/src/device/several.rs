//! Reads of many items in few requests.

use std::collections::BTreeMap;

use modio_description::Table;
use register_map::BLOCKS;

use super::Device;
use crate::failure::Failure;
use crate::names::Item;

/// Largest number of registers that one request reads.
const MOST: u16 = 120;

impl Device {
    /// Reads items, consecutive ones in one request. Returns the words of each item, in the order of the items.
    pub async fn read_items(&mut self, items: &[Item]) -> Result<Vec<Vec<u16>>, Failure> {
        let mut spans: Vec<(Table, u16, u16)> = items
            .iter()
            .map(|item| (item.table, item.address, item.words))
            .collect();
        spans.sort_unstable_by_key(|(table, address, _)| (*table == Table::Word, *address));
        spans.dedup();
        let mut found = BTreeMap::new();
        for (table, first, count) in joined(&spans) {
            let parts: Vec<_> = spans
                .iter()
                .filter(|(of, address, _)| *of == table && address.wrapping_sub(first) < count)
                .collect();
            match self.read(table, first, count).await {
                Ok(words) => found.extend(words),
                // A unit refuses a request over two of its blocks. This map knows where its own blocks begin; those of
                // newer firmware may be others.
                Err(Failure::Refused(_)) if parts.len() > 1 => {
                    for (_, address, count) in parts {
                        found.extend(self.read(table, *address, *count).await?);
                    }
                }
                Err(failure) => return Err(failure),
            }
        }
        let words = |item: &Item| {
            let addresses = (0..item.words).map(|n| item.address.wrapping_add(n));
            let word = |address| found.get(&(item.table == Table::Word, address)).copied();
            addresses
                .map(|address| word(address).unwrap_or_default())
                .collect()
        };
        Ok(items.iter().map(words).collect())
    }

    /// Reads registers or bits. Returns each value with its place.
    async fn read(
        &mut self,
        table: Table,
        first: u16,
        count: u16,
    ) -> Result<impl Iterator<Item = ((bool, u16), u16)> + use<>, Failure> {
        let words = match table {
            Table::Word => self.read_words(first, count).await?,
            Table::Bit => {
                let bits = self.read_bits(first, count).await?;
                bits.into_iter().map(u16::from).collect()
            }
        };
        let is_word = table == Table::Word;
        let places = (0..count).map(move |n| (is_word, first.wrapping_add(n)));
        Ok(places.zip(words))
    }
}

/// Joins consecutive spans, but not over the start of a block of the register map.
fn joined(spans: &[(Table, u16, u16)]) -> Vec<(Table, u16, u16)> {
    let mut joined: Vec<(Table, u16, u16)> = Vec::new();
    for (table, address, count) in spans {
        match joined.last_mut() {
            Some((before, first, length))
                if before == table
                    && !BLOCKS.iter().any(|block| block.first == *address)
                    && u32::from(*first) + u32::from(*length) == u32::from(*address)
                    && length.saturating_add(*count) <= MOST =>
            {
                *length += count;
            }
            _ => joined.push((*table, *address, *count)),
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn consecutive_items_are_read_together_and_gaps_are_not_read() {
        use Table::{Bit, Word};
        let spans = [
            (Bit, 16, 1),
            (Bit, 17, 1),
            (Word, 18, 1),
            (Word, 19, 2),
            (Word, 22, 1),
        ];
        assert_eq!(joined(&spans), [(Bit, 16, 2), (Word, 18, 3), (Word, 22, 1)]);
        let many: Vec<_> = (0..300).map(|n| (Word, 0x1000 + n, 1)).collect();
        assert_eq!(
            joined(&many),
            [(Word, 0x1000, 120), (Word, 0x1078, 120), (Word, 0x10F0, 60)]
        );
        // A description may have a longer item than there are addresses.
        let long = [(Word, 0x1000, 0xEFFF), (Word, 0xFFFF, 0xFFFF)];
        assert_eq!(joined(&long).len(), 2);
        // The fault record and the counters of the second line are two blocks.
        let blocks = [(Word, 0x026F, 1), (Word, 0x0270, 1), (Word, 0x0271, 1)];
        assert_eq!(joined(&blocks), [(Word, 0x026F, 1), (Word, 0x0270, 2)]);
    }
}
