//! The header of an image: the first 512 bytes of a slot. The vector table of the application follows.
//!
//! | offset | bytes | content, little-endian |
//! |---|---|---|
//! | 0 | 4 | `MODI` |
//! | 4 | 1, 1 | version of the header, 2; board, as in register 0x0205 |
//! | 6 | 2 | security epoch |
//! | 8 | 1, 1, 2 | version of the firmware: major, minor, patch |
//! | 12 | 4, 4 | address of the slot; bytes of the application |
//! | 20 | 4, 4 | CRC-32 of bytes 0 to 19 and the application; first 32 bits of the commit |
//! | 28 | 64 | SHA-512 of the application |
//! | 92 | 64 | Ed25519 signature of bytes 0 to 91 |
//! | 156 | 4 | first bytes of the SHA-512 of the public key |
//! | 160 | 352 | zero |

use super::{BLOCK_BYTES, Reason};

/// Bytes of the header.
const BYTES: usize = crate::layout::HEADER as usize;
/// Bytes of the header that the CRC-32 covers, together with the application.
const IN_CRC: usize = 20;
/// Bytes of the header that are signed.
const SIGNED: usize = 92;
/// Least bytes of an application.
const LEAST: usize = 512;

const MAGIC: [u8; 4] = *b"MODI";
const VERSION: u8 = 2;
/// First byte of the area that is zero.
const ZERO: usize = 160;

/// The header of an image, or the first bytes of one.
#[derive(Clone, Copy, Debug)]
pub struct Header<'a>(&'a [u8]);

impl<'a> Header<'a> {
    /// Returns the header at the beginning of a slot.
    ///
    /// # Errors
    ///
    /// [`Reason::Magic`] if there is none.
    pub fn of(slot: &'a [u8]) -> Result<Self, Reason> {
        let bytes: &[u8; BYTES] = slot.first_chunk().ok_or(Reason::Magic)?;
        let zero = bytes[ZERO..].iter().all(|byte| *byte == 0);
        Self::beginning(bytes).filter(|_| zero).ok_or(Reason::Magic)
    }

    /// Returns the header whose first bytes these are, if its magic number and its version are right.
    #[must_use]
    pub fn beginning(bytes: &'a [u8]) -> Option<Self> {
        let header = Self(bytes);
        (header.array(0) == MAGIC && header.array(4) == [VERSION]).then_some(header)
    }

    fn array<const N: usize>(&self, at: usize) -> [u8; N] {
        let rest = self.0.get(at..).unwrap_or_default();
        rest.first_chunk().copied().unwrap_or([0; N])
    }

    /// Returns the board's code.
    #[must_use]
    pub fn board(&self) -> u8 {
        let [board] = self.array(5);
        board
    }

    /// Returns the security epoch.
    #[must_use]
    pub fn epoch(&self) -> u16 {
        u16::from_le_bytes(self.array(6))
    }

    /// Returns the version of the firmware: major and minor, patch.
    #[must_use]
    pub fn version(&self) -> ([u8; 2], u16) {
        (self.array(8), u16::from_le_bytes(self.array(10)))
    }

    /// Returns the address of the slot that the image is linked for.
    #[must_use]
    pub fn address(&self) -> u32 {
        u32::from_le_bytes(self.array(12))
    }

    /// Returns the bytes of the application.
    #[must_use]
    pub fn length(&self) -> u32 {
        u32::from_le_bytes(self.array(16))
    }

    /// Returns the CRC-32.
    #[must_use]
    pub fn crc(&self) -> u32 {
        u32::from_le_bytes(self.array(20))
    }

    /// Returns the first 32 bits of the commit.
    #[must_use]
    pub fn commit(&self) -> u32 {
        u32::from_le_bytes(self.array(24))
    }

    /// Returns the SHA-512 of the application.
    #[must_use]
    pub fn hash(&self) -> [u8; 64] {
        self.array(28)
    }

    /// Returns the bytes that are signed.
    #[must_use]
    pub fn signed(&self) -> &'a [u8] {
        self.0.get(..SIGNED).unwrap_or_default()
    }

    /// Returns the Ed25519 signature.
    #[must_use]
    pub fn signature(&self) -> [u8; 64] {
        self.array(92)
    }

    /// Returns the first bytes of the SHA-512 of the public key that signed.
    #[must_use]
    pub fn key(&self) -> u32 {
        u32::from_be_bytes(self.array(156))
    }

    /// Checks that the image is for a board and for the slot at an address.
    ///
    /// # Errors
    ///
    /// [`Reason::Board`] or [`Reason::Address`].
    pub fn suits(&self, board: u8, address: u32) -> Result<(), Reason> {
        if self.board() != board {
            Err(Reason::Board)
        } else if self.address() != address {
            Err(Reason::Address)
        } else {
            Ok(())
        }
    }

    /// Returns the blocks of the image, in a slot with this number of bytes.
    ///
    /// # Errors
    ///
    /// [`Reason::Length`] unless the bytes of the application are a multiple of 4, 512 or more, and fit the slot.
    pub fn blocks(&self, slot: usize) -> Result<u16, Reason> {
        let length = self.length() as usize;
        let fits = length >= LEAST && length <= slot.saturating_sub(BYTES);
        if fits && length.is_multiple_of(4) {
            Ok((BYTES + length).div_ceil(BLOCK_BYTES) as u16)
        } else {
            Err(Reason::Length)
        }
    }

    /// Returns the application, in the slot that begins with this header.
    ///
    /// # Errors
    ///
    /// As [`Self::blocks`].
    pub fn application<'b>(&self, slot: &'b [u8]) -> Result<&'b [u8], Reason> {
        self.blocks(slot.len())?;
        let rest = slot.get(BYTES..).unwrap_or_default();
        rest.get(..self.length() as usize).ok_or(Reason::Length)
    }

    /// Returns the records of file 2 that describe the image, and behind them its CRC-32.
    #[must_use]
    pub fn words(&self) -> [u16; 10] {
        let ([major, minor], patch) = self.version();
        let words = |long: u32| [(long >> 16) as u16, long as u16];
        let [c1, c0] = words(self.commit());
        let ([k1, k0], [s1, s0]) = (words(self.key()), words(self.crc()));
        let version = u16::from_be_bytes([major, minor]);
        let blocks = self.blocks(usize::MAX).unwrap_or_default();
        [version, patch, self.epoch(), c1, c0, blocks, k1, k0, s1, s0]
    }
}

/// Returns the CRC-32 that the part's unit computes over parts whose bytes are multiples of 4, in little-endian words
/// (RM0008 4).
#[must_use]
pub fn crc32(parts: [&[u8]; 2]) -> u32 {
    parts.into_iter().fold(u32::MAX, |crc, part| {
        let words = part.as_chunks().0.iter().copied();
        words.map(u32::from_le_bytes).fold(crc, crc_of_word)
    })
}

/// Adds a word to a CRC-32, from its highest bit on: CRC-32/MPEG-2.
fn crc_of_word(crc: u32, word: u32) -> u32 {
    (0..32).fold(crc ^ word, |crc, _| {
        let out = if crc >> 31 == 0 { 0 } else { 0x04C1_1DB7 };
        crc << 1 ^ out
    })
}

/// Returns the header of an image whose magic number, bounds, zero bytes and CRC-32 are right. `crc` computes the
/// CRC-32 of parts whose bytes are multiples of 4, one after the other.
///
/// # Errors
///
/// What is wrong with it.
pub fn intact<'a>(
    slot: &'a [u8],
    crc: impl FnOnce([&[u8]; 2]) -> u32,
) -> Result<Header<'a>, Reason> {
    let header = Header::of(slot)?;
    let application = header.application(slot)?;
    let covered = header.0.get(..IN_CRC).unwrap_or_default();
    if crc([covered, application]) == header.crc() {
        Ok(header)
    } else {
        Err(Reason::Crc)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;
    /// A slot of 2 KiB with an application of 1 KiB.
    fn slot() -> Vec<u8> {
        let mut slot = std::vec![0xFF; 2048];
        slot[..BYTES].fill(0);
        slot[..4].copy_from_slice(b"MODI");
        slot[4..8].copy_from_slice(&[2, 1, 7, 0]);
        slot[8..12].copy_from_slice(&[0, 3, 4, 0]);
        slot[12..16].copy_from_slice(&0x0800_4000u32.to_le_bytes());
        slot[16..20].copy_from_slice(&1024u32.to_le_bytes());
        slot[24..28].copy_from_slice(&[0x34, 0x12, 0xCD, 0xAB]);
        (0..1024).for_each(|n| slot[BYTES + n] = (n * n) as u8);
        let right = crc32([&slot[..IN_CRC], &slot[BYTES..BYTES + 1024]]);
        slot[20..24].copy_from_slice(&right.to_le_bytes());
        slot
    }

    #[test]
    fn fields_are_at_the_offsets_of_the_contract() {
        let slot = slot();
        let header = intact(&slot, crc32).unwrap();
        assert_eq!((header.board(), header.epoch()), (1, 7));
        assert_eq!(header.version(), ([0, 3], 4));
        assert_eq!((header.address(), header.length()), (0x0800_4000, 1024));
        assert_eq!(header.commit(), 0xABCD_1234);
        let crc = [(header.crc() >> 16) as u16, header.crc() as u16];
        let words = [3, 4, 7, 0xABCD, 0x1234, 12, 0, 0, crc[0], crc[1]];
        assert_eq!(header.words(), words);
        assert_eq!(header.suits(1, 0x0800_4000), Ok(()));
        assert_eq!(header.suits(2, 0x0800_4000), Err(Reason::Board));
        assert_eq!(header.suits(1, 0x0801_1800), Err(Reason::Address));
    }

    #[test]
    fn any_wrong_bit_of_what_the_crc_covers_or_of_the_zero_area_is_found() {
        let right = slot();
        let covered = (0..24).chain(ZERO..BYTES + 1024);
        for (byte, bit) in covered.flat_map(|byte| (0..8).map(move |bit| (byte, bit))) {
            let mut wrong = right.clone();
            wrong[byte] ^= 1 << bit;
            assert!(intact(&wrong, crc32).is_err(), "byte {byte} bit {bit}");
        }
    }

    #[test]
    fn crc_is_that_of_the_parts_unit() {
        assert_eq!(
            crc32([b"4321", b"8765"]),
            0x49E3_C2FB,
            "CRC-32/MPEG-2 of 12345678"
        );
    }

    #[test]
    fn lengths_outside_the_slot_are_refused_before_anything_is_read() {
        for length in [
            0,
            508,
            510,
            1026,
            1540,
            2048,
            0x8000_0000,
            u32::MAX - 3,
            u32::MAX,
        ] {
            let mut slot = slot();
            slot[16..20].copy_from_slice(&length.to_le_bytes());
            let refused = intact(&slot, |_| unreachable!()).unwrap_err();
            assert_eq!(refused, Reason::Length, "{length}");
        }
        assert_eq!(intact(&slot()[..511], crc32).unwrap_err(), Reason::Magic);
    }
}
