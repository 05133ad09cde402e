//! A range of addresses.

/// `count` addresses from `start` on: at least one, and none above 0xFFFF, so that a span never wraps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    start: u16,
    count: u16,
}

impl Span {
    /// Returns a span, or `None` when `count` is zero or the last address is above 0xFFFF.
    #[inline]
    pub const fn new(start: u16, count: u16) -> Option<Self> {
        if count == 0 || start as u32 + count as u32 > 0x1_0000 {
            None
        } else {
            Some(Self { start, count })
        }
    }

    /// Returns a span with the single address `start`.
    #[inline]
    pub const fn single(start: u16) -> Self {
        Self { start, count: 1 }
    }

    /// Returns the first address (a PDU address: zero-based).
    #[inline]
    pub const fn start(self) -> u16 {
        self.start
    }

    /// Returns the number of addresses: 1 or more.
    #[inline]
    pub const fn count(self) -> u16 {
        self.count
    }

    /// Returns the address after the last one, up to 0x1_0000.
    #[inline]
    pub const fn end(self) -> u32 {
        self.start as u32 + self.count as u32
    }

    /// Returns whether the whole span lies within `other`.
    #[inline]
    pub const fn is_within(self, other: Self) -> bool {
        self.start >= other.start && self.end() <= other.end()
    }

    /// Iterates over every address in order.
    #[inline]
    pub fn addresses(self) -> impl DoubleEndedIterator<Item = u16> + Clone {
        // This takes fewer instructions than an inclusive range, which has to store whether it has ended. By the
        // invariant no address wraps.
        (0..self.count).map(move |index| self.start.wrapping_add(index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_has_an_address_and_never_wraps() {
        assert_eq!(Span::new(0, 0), None);
        assert_eq!(Span::new(0xFFFF, 0), None);
        assert_eq!(Span::new(0xFFFF, 2), None);
        assert_eq!(Span::new(1, 0xFFFF).map(Span::end), Some(0x1_0000));
        assert_eq!(Span::new(2, 0xFFFF), None);
        assert_eq!(Span::new(0xFFFF, 1), Some(Span::single(0xFFFF)));
    }

    #[test]
    fn a_span_can_contain_the_last_address() {
        let last = Span::new(0xFFFD, 3).unwrap();
        assert!(last.addresses().eq([0xFFFD, 0xFFFE, 0xFFFF]));
        assert!(Span::single(0).addresses().eq([0]));
    }

    #[test]
    fn is_within_requires_the_whole_span() {
        let outer = Span::new(10, 4).unwrap();
        let within = |start, count| Span::new(start, count).unwrap().is_within(outer);
        assert!(within(10, 4) && within(13, 1));
        assert!(!within(9, 2) && !within(13, 2) && !within(14, 1) && !within(9, 6));
    }
}
