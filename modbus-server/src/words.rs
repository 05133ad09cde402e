//! Registers as they are in a PDU: 16 bits, high byte first (V1.1b3 4.2).

use core::{mem, slice};

/// The registers of a write request, in the order of their addresses.
#[derive(Clone, Copy, Debug)]
pub struct Words<'a> {
    words: &'a [[u8; 2]],
}

impl<'a> Words<'a> {
    /// Creates the registers from `bytes`. An odd last byte is ignored.
    #[inline]
    pub const fn new(bytes: &'a [u8]) -> Self {
        Self {
            words: bytes.as_chunks().0,
        }
    }

    /// Returns the number of registers.
    #[inline]
    pub const fn count(self) -> usize {
        self.words.len()
    }

    /// Returns the register `index` places after the first, or `None` after the last one.
    #[inline]
    pub fn get(self, index: u16) -> Option<u16> {
        self.words
            .get(usize::from(index))
            .copied()
            .map(u16::from_be_bytes)
    }

    /// Returns `count` registers from the one `start` places after the first, or fewer at the end.
    #[inline]
    pub fn slice(self, start: u16, count: u16) -> Self {
        let (_, words) = self
            .words
            .split_at_checked(start.into())
            .unwrap_or_default();
        let words = words.get(..usize::from(count)).unwrap_or(words);
        Self { words }
    }

    /// Iterates over the registers in order.
    #[inline]
    pub fn iter(self) -> impl ExactSizeIterator<Item = u16> + 'a {
        self.words.iter().copied().map(u16::from_be_bytes)
    }
}

/// Receives the registers of a read reply, in the order of their addresses.
#[derive(Debug)]
pub struct WordsOut<'a> {
    slots: slice::IterMut<'a, [u8; 2]>,
}

impl<'a> WordsOut<'a> {
    /// Prepares room for as many registers as fit `bytes`.
    #[inline]
    pub fn new(bytes: &'a mut [u8]) -> Self {
        Self {
            slots: bytes.as_chunks_mut().0.iter_mut(),
        }
    }

    /// Appends a register. Registers without room are ignored.
    #[inline]
    pub fn push(&mut self, word: u16) {
        if let Some(slot) = self.slots.next() {
            *slot = word.to_be_bytes();
        }
    }

    /// Returns the room that is left as bytes, the high byte of each register first, for a model that has its registers
    /// as bytes. They are 0.
    #[inline]
    pub fn rest(&mut self) -> &'a mut [u8] {
        let rest = mem::take(&mut self.slots).into_slice().as_flattened_mut();
        rest.fill(0);
        rest
    }

    /// Sets the registers that were not pushed to 0, so that no old data is sent.
    pub(crate) fn finish(self) {
        for slot in self.slots {
            *slot = [0; 2];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_high_byte_is_first_and_an_odd_byte_is_ignored() {
        let words = Words::new(&[0x12, 0x34, 0x56, 0x78, 0x9A]);
        assert!(words.iter().eq([0x1234, 0x5678]));
        assert_eq!(
            (words.count(), words.get(1), words.get(2)),
            (2, Some(0x5678), None)
        );
    }

    #[test]
    fn a_slice_ends_where_the_registers_end() {
        let words = Words::new(&[0, 1, 0, 2, 0, 3]);
        assert!(words.slice(1, 2).iter().eq([2, 3]));
        assert!(words.slice(0, 1).iter().eq([1]));
        assert!(words.slice(2, 9).iter().eq([3]));
        assert_eq!(
            (words.slice(3, 1).count(), words.slice(4, 1).count()),
            (0, 0)
        );
    }

    #[test]
    fn too_many_or_too_few_pushed_registers_are_harmless() {
        let mut bytes = [0xFF; 5];
        let mut out = WordsOut::new(&mut bytes);
        (0..3).for_each(|_| out.push(0x0102));
        out.finish();
        assert_eq!(bytes, [1, 2, 1, 2, 0xFF]);
        let mut out = WordsOut::new(&mut bytes);
        out.push(0x0304);
        out.finish();
        assert_eq!(bytes, [3, 4, 0, 0, 0xFF]);
    }
}
