//! The packed part of the self-description, in flash.
//!
//! The build script replaces frequent pairs of bytes by single bytes, and pairs of these as well (byte-pair encoding,
//! `build/pack.rs`). That saves a third of the document. Unpacking can begin at every [`BLOCK`]th byte and needs no
//! memory but a few bytes that wait.

/// A packed document.
#[derive(Clone, Copy, Debug)]
pub struct Packed {
    /// Length of the document in bytes.
    pub(super) length: usize,
    pub(super) bytes: &'static [u8],
    /// Offset in `bytes` of each block of [`BLOCK`] bytes.
    pub(super) blocks: &'static [u16],
    /// For each byte from 0x80 on: the pair that it stands for, or the byte itself, twice.
    pub(super) pairs: &'static [[u8; 2]],
}

/// Bytes of the document between two positions at which unpacking can begin.
pub(super) const BLOCK: usize = 256;
/// First byte that can stand for a pair.
const FIRST: u8 = 0x80;
/// Room for the second bytes of pairs that wait while a byte is being unpacked.
pub(super) const DEPTH: usize = 12;

impl Packed {
    /// Returns the bytes of the document from a position on.
    pub(super) fn bytes_from(&self, at: usize) -> Unpacking {
        let start = self.blocks.get(at / BLOCK);
        let rest = start.and_then(|start| self.bytes.get(usize::from(*start)..));
        let mut unpacking = Unpacking {
            rest: rest.unwrap_or_default(),
            pairs: self.pairs,
            waiting: [0; DEPTH],
            depth: 0,
        };
        for _ in 0..at % BLOCK {
            unpacking.next();
        }
        unpacking
    }
}

/// Returns the bytes of a packed document, one after another.
pub(super) struct Unpacking {
    rest: &'static [u8],
    pairs: &'static [[u8; 2]],
    /// Bytes that come after the one that is being unpacked, the next one last.
    waiting: [u8; DEPTH],
    depth: usize,
}

impl Iterator for Unpacking {
    type Item = u8;

    #[inline(never)]
    fn next(&mut self) -> Option<u8> {
        let mut byte = match self.depth.checked_sub(1) {
            Some(depth) => {
                self.depth = depth;
                *self.waiting.get(depth)?
            }
            None => {
                let (first, rest) = self.rest.split_first()?;
                self.rest = rest;
                *first
            }
        };
        loop {
            let pair = byte.checked_sub(FIRST);
            let pair = pair.and_then(|index| self.pairs.get(usize::from(index)));
            match pair {
                Some([first, second]) if *first != byte => {
                    // The build script checks that there is room.
                    *self.waiting.get_mut(self.depth)? = *second;
                    self.depth = self.depth.wrapping_add(1);
                    byte = *first;
                }
                _ => return Some(byte),
            }
        }
    }
}
