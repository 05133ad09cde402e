//! The packed part of the self-description, in flash.
//!
//! The build script replaces frequent phrases by single bytes (`build/pack.rs`). Reading can begin at every [`BLOCK`]th
//! byte of the document and passes over whole phrases from there, because a request with many groups of records skips
//! to a new position for each of them while its reply is already being sent.

use core::slice;

/// A packed document.
#[derive(Clone, Copy, Debug)]
pub struct Packed {
    /// Length of the document in bytes.
    pub(super) length: usize,
    pub(super) bytes: &'static [u8],
    /// Offset in `bytes` of each block of [`BLOCK`] bytes.
    pub(super) blocks: &'static [u16],
    /// For each byte from 0x80 on: offset and length in `text` of the phrase that it stands for.
    pub(super) phrases: &'static [[u8; 2]],
    pub(super) text: &'static [u8],
}

/// Bytes of the document between two positions at which reading can begin.
pub(super) const BLOCK: usize = 32;
/// First byte that stands for a phrase.
const FIRST: u8 = 0x80;

impl Packed {
    /// Copies the document from a position on to `out`, as far as there is room.
    pub(super) fn copy(&self, at: usize, out: &mut slice::IterMut<'_, u8>) {
        let start = self.blocks.get(at / BLOCK);
        let packed = start.and_then(|start| self.bytes.get(usize::from(*start)..));
        let mut skip = at % BLOCK;
        for byte in packed.unwrap_or_default() {
            if let Some(more) = skip.checked_sub(self.length(*byte)) {
                skip = more;
                continue;
            }
            if !copy(self.phrase(byte).get(skip..).unwrap_or_default(), out) {
                return;
            }
            skip = 0;
        }
    }

    /// Returns what a packed byte stands for.
    #[inline]
    fn phrase(&self, byte: &'static u8) -> &'static [u8] {
        let Some(code) = byte.checked_sub(FIRST) else {
            return slice::from_ref(byte);
        };
        let phrase = self.phrases.get(usize::from(code));
        let phrase = phrase.and_then(|[offset, length]| {
            self.text
                .get(usize::from(*offset)..)?
                .get(..usize::from(*length))
        });
        phrase.unwrap_or_default()
    }

    /// Returns the length of what a packed byte stands for.
    #[inline]
    fn length(&self, byte: u8) -> usize {
        let code = byte.checked_sub(FIRST);
        let phrase = code.and_then(|code| self.phrases.get(usize::from(code)));
        phrase.map_or(1, |[_, length]| usize::from(*length))
    }
}

/// Copies bytes to `out`. Returns false when there is no more room.
#[inline(always)]
pub(super) fn copy(bytes: &[u8], out: &mut slice::IterMut<'_, u8>) -> bool {
    for byte in bytes {
        let Some(slot) = out.next() else {
            return false;
        };
        *slot = *byte;
    }
    true
}
