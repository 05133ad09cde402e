//! The buffer of one frame. The receiver fills it, and the server makes it the reply.

/// One application data unit of up to 256 bytes (V1.02 2.5.1: the largest RTU frame, including address and CRC; an
/// ASCII frame holds at most 255).
///
/// It holds the unit address and the PDU. The receiver removes a valid CRC or LRC, and that of a reply is never in it.
#[derive(Debug)]
pub struct Adu {
    bytes: [u8; Adu::CAPACITY],
    /// Number of bytes in use, at most `CAPACITY`.
    len: usize,
}

impl Adu {
    /// Largest number of bytes in a frame.
    pub const CAPACITY: usize = 256;

    /// Returns an empty buffer.
    pub const fn new() -> Self {
        Self {
            bytes: [0; Self::CAPACITY],
            len: 0,
        }
    }

    /// Appends a byte. Returns `false` and changes nothing when the buffer is full.
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

    /// Appends as many of these bytes as there is room for.
    pub(crate) fn extend(&mut self, bytes: &[u8]) {
        // `push` reports a full buffer; the remaining bytes are dropped.
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

    /// Returns the number of bytes in use.
    #[inline]
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Returns whether no byte is in use.
    #[inline]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns the bytes in use.
    #[inline]
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..self.len).unwrap_or_default()
    }

    /// Discards the bytes after the first `len`.
    #[inline]
    pub const fn truncate(&mut self, len: usize) {
        if len < self.len {
            self.len = len;
        }
    }

    /// Discards the last `count` bytes.
    #[inline]
    pub(crate) const fn cut(&mut self, count: usize) {
        self.len = self.len.saturating_sub(count);
    }

    /// Discards the first `count` bytes.
    pub(crate) fn drop_front(&mut self, count: u8) {
        for at in 0..=u8::MAX - count {
            self.set(at, self.get(at + count));
        }
        self.cut(count.into());
    }

    /// Inserts `count` bytes at the front, with any content. Returns `false` and changes nothing when less than the two
    /// bytes of a CRC would be left free.
    pub(crate) fn add_front(&mut self, count: u8) -> bool {
        let len = self.len + usize::from(count);
        if len + 2 > Self::CAPACITY {
            return false;
        }
        self.len = len;
        for at in (0..=u8::MAX - count).rev() {
            self.set(at + count, self.get(at));
        }
        true
    }

    /// Discards the content.
    #[inline]
    pub const fn clear(&mut self) {
        self.len = 0;
    }

    /// Returns the byte at `index`, whether it is in use or not.
    #[inline]
    pub(crate) fn get(&self, index: u8) -> u8 {
        // The index is always in range, so the compiler removes this check.
        self.bytes
            .get(usize::from(index))
            .copied()
            .unwrap_or_default()
    }

    /// Returns the bytes after the function code.
    #[inline(always)]
    pub(crate) fn fields(&self) -> &[u8] {
        self.bytes.get(2..self.len).unwrap_or_default()
    }

    /// Returns the bytes from `index` on, or none if there are fewer.
    #[inline]
    pub(crate) fn from(&self, index: u8) -> &[u8] {
        self.bytes
            .get(usize::from(index)..self.len)
            .unwrap_or_default()
    }

    /// Sets the length to `len`, at most [`CAPACITY`](Self::CAPACITY), with any content, and returns the bytes for
    /// writing.
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
    fn a_full_buffer_rejects_a_byte() {
        let mut adu = Adu::new();
        assert!(adu.is_empty());
        assert!((0..=255).all(|byte| adu.push(byte)));
        assert!(!adu.push(7));
        assert_eq!((adu.len(), adu.as_slice().last()), (256, Some(&255)));
        adu.clear();
        assert_eq!(adu.as_slice(), []);
    }

    #[test]
    fn truncating_never_makes_a_buffer_longer() {
        let mut adu = Adu::new();
        adu.extend(&[1, 2, 3]);
        adu.truncate(1);
        assert_eq!(adu.as_slice(), [1]);
        adu.truncate(4);
        assert_eq!(adu.as_slice(), [1]);
    }

    #[test]
    fn only_bytes_in_use_are_overwritten_and_only_fitting_bytes_are_kept() {
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
    fn reading_after_the_end_returns_nothing() {
        let mut adu = Adu::new();
        assert_eq!(adu.resize(1000).len(), Adu::CAPACITY);
        adu.resize(3);
        assert_eq!((adu.from(2).len(), adu.from(4).len()), (1, 0));
    }
}
