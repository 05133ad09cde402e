//! The fuzzer's bytes, decoded as a script from front to back.

use arbitrary::Unstructured;

/// The rest of an input. After its end it returns zeros and shorter strings.
#[derive(Debug)]
pub struct Script<'a>(Unstructured<'a>);

impl<'a> Script<'a> {
    /// Creates the script from these bytes.
    #[must_use]
    pub fn new(input: &'a [u8]) -> Self {
        Self(Unstructured::new(input))
    }

    /// Returns the byte that selects the next event, or `None` at the end.
    pub fn tag(&mut self) -> Option<u8> {
        (!self.0.is_empty()).then(|| self.byte())
    }

    /// Returns a byte.
    pub fn byte(&mut self) -> u8 {
        self.0.arbitrary().unwrap_or(0)
    }

    /// Returns a half-word, low byte first.
    pub fn half(&mut self) -> u16 {
        self.0.arbitrary().unwrap_or(0)
    }

    /// Returns a word, low byte first.
    pub fn word(&mut self) -> u32 {
        self.0.arbitrary().unwrap_or(0)
    }

    /// Returns `count` bytes, or as many as are left.
    pub fn bytes(&mut self, count: usize) -> &'a [u8] {
        let count = count.min(self.0.len());
        self.0.bytes(count).unwrap_or_default()
    }

    /// Returns a string: a length in one byte, then that many bytes.
    pub fn string(&mut self) -> &'a [u8] {
        let count = self.byte();
        self.bytes(usize::from(count))
    }
}
