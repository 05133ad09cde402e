//! A text that is made while it is put into a reply.

use core::fmt;

/// Takes the bytes of a device identification object ([`DataModel::identification`]), also by
/// [`write!`].
///
/// [`DataModel::identification`]: crate::DataModel::identification
#[derive(Debug)]
pub struct TextOut<'a> {
    bytes: &'a mut [u8],
    /// Length of the whole text, whether it fits or not.
    len: usize,
}

impl<'a> TextOut<'a> {
    /// Room for as many bytes as `bytes` has.
    #[inline]
    pub const fn new(bytes: &'a mut [u8]) -> Self {
        Self { bytes, len: 0 }
    }

    /// Appends bytes; more than there is room for are only counted.
    pub fn extend(&mut self, text: &[u8]) {
        let room = self.bytes.get_mut(self.len..).unwrap_or_default();
        let slots = room.iter_mut().zip(text);
        slots.for_each(|(slot, byte)| *slot = *byte);
        self.len = self.len.saturating_add(text.len());
    }

    /// Length of all bytes that were appended, whether they fit or not.
    #[inline]
    pub const fn len(&self) -> usize {
        self.len
    }

    /// Whether nothing was appended.
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
