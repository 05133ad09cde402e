//! Which blocks of an image are missing.

use register_map::update::BLOCK_BYTES;

/// Words for the largest slot, 116 KiB.
const WORDS: usize = 116 * 1024 / BLOCK_BYTES / 16;

/// The blocks of an image, each of which is missing or not.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Missing {
    blocks: u16,
    /// One bit for each block, lowest first.
    words: [u16; WORDS],
}

impl Missing {
    /// Returns the blocks of an image that is missing altogether.
    pub(super) fn all(blocks: u16) -> Self {
        let mut missing = Self {
            blocks: blocks.min(WORDS as u16 * 16),
            words: [0; WORDS],
        };
        missing.mark(0, blocks);
        missing
    }

    /// Returns the number of blocks, missing or not.
    pub(super) const fn blocks(&self) -> u16 {
        self.blocks
    }

    /// Notes that blocks are missing.
    pub(super) fn mark(&mut self, first: u16, count: u16) {
        for block in first..first.saturating_add(count).min(self.blocks) {
            if let Some(word) = self.words.get_mut(usize::from(block / 16)) {
                *word |= 1 << (block % 16);
            }
        }
    }

    /// Notes that a block is there.
    pub(super) fn clear(&mut self, block: u16) {
        if let Some(word) = self.words.get_mut(usize::from(block / 16)) {
            *word &= !(1 << (block % 16));
        }
    }

    /// Returns the number of missing blocks.
    pub(super) fn count(&self) -> u16 {
        self.words.iter().map(|word| word.count_ones() as u16).sum()
    }

    /// Returns the bits of 16 blocks, from block 16 * `index` on.
    pub(super) fn word(&self, index: u16) -> u16 {
        let word = self.words.get(usize::from(index));
        word.copied().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_missing_until_they_are_there() {
        let mut missing = Missing::all(20);
        assert_eq!((missing.blocks(), missing.count()), (20, 20));
        assert_eq!([0, 1, 2].map(|n| missing.word(n)), [0xFFFF, 0x000F, 0]);
        for block in [0, 17, 17] {
            missing.clear(block);
        }
        assert_eq!([0, 1].map(|n| missing.word(n)), [0xFFFE, 0x000D]);
        missing.mark(16, 8);
        assert_eq!(missing.word(1), 0x000F, "there is no block 20");
        assert_eq!(missing.count(), 19);
        let largest = Missing::all(928);
        assert_eq!((largest.count(), largest.word(57)), (928, 0xFFFF));
        assert_eq!(Missing::all(u16::MAX), largest);
    }
}
