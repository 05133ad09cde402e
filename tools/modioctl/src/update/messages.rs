//! The requests of an update, and what their answers say.

use modbus_line::adu::{pdu, words_of};
use register_map::configuration::{COMMAND, KEY, OPENING_KEY};
use register_map::state::{COMMIT, FIRMWARE_VERSION, UPDATE, update};
use register_map::update::{BLOCK, BLOCK_BYTES, Slot, State, place_of, status};

use super::Image;
use crate::value::long;

/// Records of file 2 that a poll during the transfer reads.
const SHORT: u16 = status::SLOT + 1;
/// Records of file 2 with both images.
pub(super) const LONG: u16 = status::CRCS.end;
/// Registers from the version to the commit.
const IDENTITY: u16 = COMMIT + 2 - FIRMWARE_VERSION;

/// File 2: the state of an update.
#[derive(Clone, Debug)]
pub struct Status {
    /// State of the slot that does not run; `None` for a code that this program does not know.
    pub state: Option<State>,
    /// Why the image in that slot was rejected; 0 if it was not.
    pub reason: u16,
    /// Blocks of the image; 0 until its header is known.
    pub blocks: u16,
    /// Blocks that are missing.
    pub missing: u16,
    /// The slot that runs.
    pub slot: Slot,
    /// The lowest security epoch that is accepted; 0 in a short answer, as all that follows.
    pub floor: u16,
    /// Pages that are still to be erased.
    pub pages: u16,
    /// The running image and the one in the other slot.
    pub images: [[u16; 8]; 2],
    /// CRC-32 of both images; 0 if there is none, or if the unit does not report it.
    pub crcs: [u32; 2],
    /// Numbers of the loader's first and second key; 0 if the unit does not report them.
    pub keys: [u32; 2],
    /// The first key is revoked.
    pub revoked: bool,
}

impl Status {
    /// Returns the status in the first records of file 2.
    #[must_use]
    pub fn of(words: &[u16]) -> Option<Self> {
        let word = |record: u16| words.get(usize::from(record)).copied();
        let code = word(status::STATE)?;
        let reason = word(status::REASON)?;
        let rest = |record: u16| word(record).unwrap_or_default();
        let image = |first: u16| std::array::from_fn(|n| rest(first + n as u16));
        let longs =
            |first: u16| [first, first + 2].map(|record| long(&[rest(record), rest(record + 1)]));
        // A reason may also be why a block was refused, while blocks are received.
        let detail = if matches!(code, 4 | 6) { reason } else { 0 };
        let byte = |word: u16| u8::try_from(word).ok();
        Some(Self {
            state: byte(code)
                .zip(byte(detail))
                .and_then(|(code, detail)| State::from_code(code, detail)),
            reason,
            blocks: word(status::BLOCKS)?,
            missing: word(status::MISSING)?,
            slot: match word(status::SLOT)? {
                1 => Slot::A,
                2 => Slot::B,
                _ => return None,
            },
            floor: rest(status::FLOOR),
            pages: rest(status::PAGES),
            images: [status::RUNNING.start, status::OTHER.start].map(image),
            crcs: longs(status::CRCS.start),
            keys: longs(status::KEYS.start),
            revoked: rest(status::REVOKED) & 1 == 1,
        })
    }

    /// Returns whether the unit, whose board is that of the image, runs this image, perhaps signed with another key. A unit
    /// that does not report the CRC-32 may run another one.
    #[must_use]
    pub fn runs(&self, image: &Image) -> bool {
        let ([words, _], [crc, _]) = (&self.images, self.crcs);
        crc != 0 && (words[2], crc) == (image.epoch(), image.crc)
    }

    /// Returns whether the other slot has the header of exactly this image.
    #[must_use]
    pub fn has(&self, image: &Image) -> bool {
        let ([_, words], [_, crc]) = (&self.images, self.crcs);
        crc != 0 && *words == image.words && crc == image.crc
    }
}

/// Returns the request for the state of an update and both images.
#[must_use]
pub fn read_status() -> Vec<u8> {
    read(status::STATE, LONG)
}

/// Returns the request for the state of an update alone.
pub(super) fn read_short() -> Vec<u8> {
    read(status::STATE, SHORT)
}

/// Returns the request for the bits of this number of blocks.
pub(super) fn read_bits(blocks: usize) -> Vec<u8> {
    read(status::BITMAP, blocks.div_ceil(16) as u16)
}

/// Returns a request for records of file 2.
fn read(first: u16, count: u16) -> Vec<u8> {
    let mut request = vec![0x14, 7, 6];
    let fields = [status::FILE, first, count].map(u16::to_be_bytes);
    request.extend(fields.as_flattened());
    request
}

/// Returns the words in an answer of function 14.
pub(super) fn records(answer: &[u8]) -> Vec<u16> {
    let words = answer.get(4..).filter(|_| answer[0] == 0x14);
    let (words, _) = words.unwrap_or_default().as_chunks();
    words.iter().copied().map(u16::from_be_bytes).collect()
}

/// Returns the request that writes a block.
pub(super) fn write_block(slot: Slot, number: u16, block: &[u8; BLOCK_BYTES]) -> Vec<u8> {
    let (file, record) = place_of(slot, number);
    let mut request = vec![0x15, 7 + BLOCK_BYTES as u8, 6];
    request.extend([file, record, BLOCK].map(u16::to_be_bytes).as_flattened());
    request.extend(block);
    request
}

/// Returns a request that every modio ignores in a broadcast: file 2 cannot be written.
pub(super) fn harmless() -> Vec<u8> {
    let [high, low] = status::FILE.to_be_bytes();
    vec![0x15, 9, 6, high, low, 0, 0, 0, 1, 0, 0]
}

/// Returns the request that opens the lock.
pub(super) fn unlock() -> Vec<u8> {
    pdu(6, KEY, OPENING_KEY)
}

/// Returns the request that gives an order.
pub(super) fn order(command: u16) -> Vec<u8> {
    pdu(6, COMMAND, command)
}

/// Returns the request for the registers with version and commit of the running image.
pub(super) fn read_identity() -> Vec<u8> {
    pdu(3, FIRMWARE_VERSION, IDENTITY)
}

/// Returns whether version and commit in the registers are those of an image.
pub(super) fn is_identity(answer: &[u8], image: &[u16; 8]) -> bool {
    let words = words_of(answer);
    let [version, patch, _, high, low, ..] = *image;
    words.starts_with(&[version, patch]) && words.ends_with(&[high, low])
}

/// Returns the request for register UPDATE.
pub(super) fn read_register() -> Vec<u8> {
    pdu(3, UPDATE, 1)
}

/// Returns whether register UPDATE says that this slot runs and is confirmed.
pub(super) fn is_confirmed(answer: &[u8], slot: Slot) -> bool {
    let runs = slot as u16 + 1;
    words_of(answer)
        .first()
        .is_some_and(|word| word & (update::SLOT | update::TRIAL) == runs)
}
