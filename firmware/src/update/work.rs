//! What the background task does for an update, one step at a time.

use boot_state::Record;
use ports::pages::Slot;
use register_map::update::{BLOCK_BYTES, Header, Reason, intact};

/// A block of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    pub(super) number: u16,
    pub(super) bytes: [u8; BLOCK_BYTES],
}

/// A step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Job {
    /// Write this boot state.
    Write(Record),
    /// Do this in the slot that does not run.
    InSlot(InSlot),
}

/// A step in the slot that does not run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum InSlot {
    /// Erase this page.
    Erase(u16),
    /// Program what differs of this block.
    Program(Block),
    /// Check that the image is intact.
    Check,
}

/// A step has not done what it was for: the page is not erased, the block does not fit what lies there, the boot state is
/// not written, or the image is not intact, with what is wrong with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Failed(pub Option<Reason>);

impl InSlot {
    /// Performs the step. Returns how it has ended. `crc` computes a CRC-32.
    ///
    /// # Errors
    ///
    /// When the flash refuses an operation. The step may be performed again.
    pub fn perform<S: Slot>(
        &self,
        slot: &mut S,
        crc: impl FnOnce([&[u8]; 2]) -> u32,
    ) -> Result<Result<(), Failed>, S::Error> {
        let done = match self {
            Self::Erase(page) => {
                let page = usize::from(*page);
                slot.erase(page)?;
                let size = slot.page_bytes();
                let bytes = slot.bytes().get(page * size..).unwrap_or_default();
                let mut bytes = bytes.iter().take(size);
                bytes.all(|byte| *byte == 0xFF)
            }
            Self::Program(block) => program(slot, block)?,
            Self::Check => {
                let intact = intact(slot.bytes(), crc);
                return Ok(intact.map(drop).map_err(|reason| Failed(Some(reason))));
            }
        };
        Ok(if done { Ok(()) } else { Err(Failed(None)) })
    }
}

/// Programs the half-words of a block that differ. Returns false when one does not fit what lies there.
fn program<S: Slot>(slot: &mut S, block: &Block) -> Result<bool, S::Error> {
    let first = usize::from(block.number) * BLOCK_BYTES;
    for (n, bytes) in block.bytes.as_chunks().0.iter().enumerate() {
        let offset = first + 2 * n;
        let half = u16::from_le_bytes(*bytes);
        let there = read(slot, offset);
        // Over a programmed half-word only 0 can be programmed (PM0075 2.3.3).
        if there == half {
            continue;
        }
        if there != 0xFFFF && half != 0 {
            return Ok(false);
        }
        slot.program(offset, half)?;
        if read(slot, offset) != half {
            return Ok(false);
        }
    }
    Ok(true)
}

fn read(slot: &impl Slot, offset: usize) -> u16 {
    let bytes = slot.bytes().get(offset..).unwrap_or_default();
    u16::from_le_bytes(bytes.first_chunk().copied().unwrap_or_default())
}

/// Returns what file 2 reports of the image in a slot, and its CRC-32. Zero without an image.
#[must_use]
pub fn described(slot: &[u8]) -> [u16; 10] {
    Header::of(slot).map_or([0; 10], |header| header.words())
}
