//! A run of addresses.

/// `count` addresses from `start` on: at least one, and none beyond 0xFFFF, so that a span never
/// wraps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Span {
    start: u16,
    count: u16,
}

impl Span {
    /// `None` when `count` is zero or the last address would lie beyond 0xFFFF.
    #[inline]
    pub const fn new(start: u16, count: u16) -> Option<Self> {
        if count == 0 || start as u32 + count as u32 > 0x1_0000 {
            None
        } else {
            Some(Self { start, count })
        }
    }

    /// The single address `start`.
    #[inline]
    pub const fn single(start: u16) -> Self {
        Self { start, count: 1 }
    }

    /// The first address (a PDU address: zero-based).
    #[inline]
    pub const fn start(self) -> u16 {
        self.start
    }

    /// How many addresses: 1 or more.
    #[inline]
    pub const fn count(self) -> u16 {
        self.count
    }

    /// The address after the last one, up to 0x1_0000.
    #[inline]
    pub const fn end(self) -> u32 {
        self.start as u32 + self.count as u32
    }

    /// Whether the whole span lies within `other`.
    #[inline]
    pub const fn is_within(self, other: Self) -> bool {
        self.start >= other.start && self.end() <= other.end()
    }

    /// Every address in order.
    #[inline]
    pub fn addresses(self) -> impl DoubleEndedIterator<Item = u16> + Clone {
        // Takes fewer instructions than an inclusive range, which has to remember its end. No address
        // wraps, by the invariant.
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
    fn its_addresses_reach_the_very_last() {
        let last = Span::new(0xFFFD, 3).unwrap();
        assert!(last.addresses().eq([0xFFFD, 0xFFFE, 0xFFFF]));
        assert!(Span::single(0).addresses().eq([0]));
    }

    #[test]
    fn within_means_all_of_it() {
        let outer = Span::new(10, 4).unwrap();
        let within = |start, count| Span::new(start, count).unwrap().is_within(outer);
        assert!(within(10, 4) && within(13, 1));
        assert!(!within(9, 2) && !within(13, 2) && !within(14, 1) && !within(9, 6));
    }
}
