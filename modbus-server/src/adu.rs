//! The buffer of one frame: filled by the receiver, read by the server, reused for the body of the
//! reply.

/// One application data unit of up to 256 bytes (V1.02 2.5.1: the largest RTU frame, address and
/// CRC included; an ASCII frame holds at most 255).
///
/// As a request it holds the unit address and the PDU; the CRC or LRC is cut off once it has been
/// found good. As a reply it holds what follows the head.
#[derive(Debug)]
pub struct Adu {
    bytes: [u8; Adu::CAPACITY],
    /// Never above `CAPACITY`.
    len: usize,
}

impl Adu {
    /// The most bytes a frame can have.
    pub const CAPACITY: usize = 256;

    /// An empty buffer.
    pub const fn new() -> Self {
        Self {
            bytes: [0; Self::CAPACITY],
            len: 0,
        }
    }

    /// Appends a byte. `false`: the buffer is full and unchanged.
    #[inline]
    pub fn push(&mut self, byte: u8) -> bool {
        let len = self.len;
        match self.bytes.get_mut(len) {
            Some(slot) => {
                *slot = byte;
                self.len = len + 1;
                true
            }
            None => false,
        }
    }

    /// Appends bytes, as many of them as there is room for.
    pub(crate) fn extend(&mut self, bytes: &[u8]) {
        // A full buffer takes no more: `push` says so, and there is nothing to be done.
        bytes.iter().for_each(|byte| {
            self.push(*byte);
        });
    }

    /// Overwrites the byte at `index`, if it is in use.
    pub(crate) fn set(&mut self, index: u8, byte: u8) {
        let index = usize::from(index);
        if index < self.len
            && let Some(slot) = self.bytes.get_mut(index)
        {
            *slot = byte;
        }
    }

    /// How many bytes are in use.
    #[inline]
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Whether none is.
    #[inline]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The bytes in use.
    #[inline]
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or_default()
    }

    /// Forgets the content.
    #[inline]
    pub const fn clear(&mut self) {
        self.len = 0;
    }

    /// The byte at `index`, whether in use or not.
    #[inline]
    pub(crate) fn get(&self, index: u8) -> u8 {
        // Always there: no check is left of this.
        self.bytes
            .get(usize::from(index))
            .copied()
            .unwrap_or_default()
    }

    /// The bytes from `index` on; none, if there are fewer.
    #[inline]
    pub(crate) fn from(&self, index: u8) -> &[u8] {
        self.bytes
            .get(usize::from(index)..self.len)
            .unwrap_or_default()
    }

    /// Cuts off the last `count` bytes.
    #[inline]
    pub(crate) fn cut(&mut self, count: usize) {
        self.len = self.len.saturating_sub(count);
    }

    /// Makes the buffer `len` bytes long (at most [`CAPACITY`](Self::CAPACITY)), whatever they
    /// hold, and lends them for writing.
    pub(crate) fn resize(&mut self, len: usize) -> &mut [u8] {
        self.len = len.min(Self::CAPACITY);
        self.bytes.get_mut(..self.len).unwrap_or_default()
    }
}

impl Default for Adu {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_buffer_takes_no_more() {
        let mut adu = Adu::new();
        assert!(adu.is_empty());
        assert!((0..=255).all(|byte| adu.push(byte)));
        assert!(!adu.push(7));
        assert_eq!((adu.len(), adu.as_slice().last()), (256, Some(&255)));
        adu.clear();
        assert_eq!(adu.as_slice(), []);
    }

    #[test]
    fn more_cannot_be_cut_off_than_there_is() {
        let mut adu = Adu::new();
        adu.extend(&[1, 2, 3]);
        adu.cut(2);
        assert_eq!(adu.as_slice(), [1]);
        adu.cut(4);
        assert!(adu.is_empty());
    }

    #[test]
    fn only_bytes_in_use_are_overwritten_and_no_more_kept_than_fit() {
        let mut adu = Adu::new();
        adu.extend(&[1, 2]);
        adu.set(1, 9);
        adu.set(2, 9);
        assert_eq!(adu.as_slice(), [1, 9]);
        adu.push(3);
        assert_eq!(adu.as_slice(), [1, 9, 3]);
        adu.extend(&[7; 300]);
        assert_eq!((adu.len(), adu.get(255)), (Adu::CAPACITY, 7));
    }

    #[test]
    fn nothing_reaches_beyond_the_end() {
        let mut adu = Adu::new();
        assert_eq!(adu.resize(1000).len(), Adu::CAPACITY);
        adu.resize(3);
        assert_eq!((adu.from(2).len(), adu.from(4).len()), (1, 0));
    }
}
