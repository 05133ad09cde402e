//! A text that is written directly into a reply.

use core::fmt;

/// Receives the bytes of a device identification object ([`DataModel::identification`]), also through [`write!`].
///
/// [`DataModel::identification`]: crate::DataModel::identification
#[derive(Debug)]
pub struct TextOut<'a> {
    bytes: &'a mut [u8],
    /// Length of the whole text, including bytes that did not fit.
    len: usize,
}

impl<'a> TextOut<'a> {
    /// Prepares room for the length of `bytes`.
    #[inline]
    pub const fn new(bytes: &'a mut [u8]) -> Self {
        Self { bytes, len: 0 }
    }

    /// Appends bytes. Bytes without room are only counted.
    pub fn extend(&mut self, text: &[u8]) {
        let room = self.bytes.get_mut(self.len..).unwrap_or_default();
        let slots = room.iter_mut().zip(text);
        slots.for_each(|(slot, byte)| *slot = *byte);
        self.len = self.len.saturating_add(text.len());
    }

    /// Returns the number of all appended bytes, including those that did not fit.
    #[inline]
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Returns whether nothing was appended.
    #[inline]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }
}

impl fmt::Write for TextOut<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.extend(text.as_bytes());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use core::fmt::Write;

    use super::*;

    #[test]
    fn bytes_without_room_are_counted() {
        let mut bytes = [0; 5];
        let mut text = TextOut::new(&mut bytes);
        assert!(text.is_empty());
        text.extend(b"No");
        write!(text, " {:03}", 7).unwrap();
        text.extend(b"!");
        assert_eq!(text.len(), 7);
        assert_eq!(&bytes, b"No 00");
    }
}
