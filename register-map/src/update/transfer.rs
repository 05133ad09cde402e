//! How an image reaches a unit: as file records, functions 14 and 15 (V1.1b3 6.14, 6.15). A record is one word, whose high
//! byte is the earlier byte of the image.

use core::ops::Range;

use super::Slot;

/// Bytes of a block, the unit in which an image is sent.
pub const BLOCK_BYTES: usize = 128;

/// Records of a block.
pub const BLOCK: u16 = 64;

/// Records of an image in one file. The rest is in the files after it.
const IN_FILE: u16 = 8192;

/// The first files of the images for slots A and B.
const FILES: [u16; 2] = [0x100, 0x180];

/// Returns the file and the first record of a block of the image for a slot.
#[must_use]
pub const fn place_of(slot: Slot, block: u16) -> (u16, u16) {
    let blocks = IN_FILE / BLOCK;
    let file = FILES[slot as usize % 2] + block / blocks;
    (file, block % blocks * BLOCK)
}

/// Returns the slot and the block that begins at a record of a file, or `None` if none does.
#[must_use]
pub fn block_at(file: u16, record: u16) -> Option<(Slot, u16)> {
    let [a, b] = FILES;
    let (slot, first) = if file < b { (Slot::A, a) } else { (Slot::B, b) };
    let index = file.checked_sub(first).filter(|index| *index < b - a)?;
    let begins = record < IN_FILE && record.is_multiple_of(BLOCK);
    begins.then_some((slot, index * (IN_FILE / BLOCK) + record / BLOCK))
}

/// File 2, the state of an update: its records.
pub mod status {
    use super::Range;

    /// The file.
    pub const FILE: u16 = 2;
    /// Code of the state of the slot that does not run.
    pub const STATE: u16 = 0;
    /// Why its image was rejected, or the number of its starts on trial.
    pub const REASON: u16 = 1;
    /// Blocks of the image; 0 until its header is known.
    pub const BLOCKS: u16 = 2;
    /// Blocks that are missing.
    pub const MISSING: u16 = 3;
    /// The slot that runs: 1 A, 2 B.
    pub const SLOT: u16 = 4;
    /// The lowest security epoch of an image that is accepted.
    pub const FLOOR: u16 = 5;
    /// Pages that are still to be erased.
    pub const PAGES: u16 = 6;
    /// The image that runs: version, patch level, epoch, commit (high, low), blocks, key (high, low).
    pub const RUNNING: Range<u16> = 8..16;
    /// The image in the other slot. Zero if it has no header.
    pub const OTHER: Range<u16> = 16..24;
    /// CRC-32 of the image that runs and of the one in the other slot, each high and low word.
    pub const CRCS: Range<u16> = 24..28;
    /// Numbers of the loader's two keys, each high and low word. Zero if the loader does not say them.
    pub const KEYS: Range<u16> = 28..32;
    /// Bit 0: the first key is revoked.
    pub const REVOKED: u16 = 32;
    /// One bit for each block, lowest first: 1 is missing.
    pub const BITMAP: u16 = 64;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_block_of_the_largest_slot_has_its_own_place() {
        for slot in Slot::ALL {
            for block in 0..928 {
                let (file, record) = place_of(slot, block);
                assert_eq!(block_at(file, record), Some((slot, block)));
                assert_eq!(block_at(file, record + 1), None);
            }
        }
        assert_eq!(place_of(Slot::B, 129), (0x181, 64));
        for (file, record) in [(0xFF, 0), (2, 0), (0x200, 0), (0x100, 8192), (0, 64)] {
            assert_eq!(block_at(file, record), None, "{file:#x} {record}");
        }
    }
}
