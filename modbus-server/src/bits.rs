//! Bits as a PDU packs them: eight to a byte, the first in bit 0 (V1.1b3 6.1, 6.11).

/// The bits of a write request, in the order of their addresses.
#[derive(Clone, Copy, Debug)]
pub struct Bits<'a> {
    bytes: &'a [u8],
    count: u16,
}

impl<'a> Bits<'a> {
    /// Creates `count` bits from packed bytes. Bits that `bytes` does not contain read as 0.
    #[inline]
    pub const fn new(bytes: &'a [u8], count: u16) -> Self {
        Self { bytes, count }
    }

    /// Returns the number of bits.
    #[inline]
    pub const fn count(self) -> u16 {
        self.count
    }

    /// Returns the bit `index` places after the first, or `None` after the last one. The padding in the last byte
    /// is never returned.
    #[inline]
    pub fn get(self, index: u16) -> Option<bool> {
        if index >= self.count {
            return None;
        }
        let byte = self.bytes.get(usize::from(index / 8)).copied().unwrap_or(0);
        Some(byte >> (index % 8) & 1 != 0)
    }

    /// Iterates over the bits in order.
    #[inline]
    pub fn iter(self) -> impl Iterator<Item = bool> + 'a {
        (0..self.count).map_while(move |index| self.get(index))
    }
}

/// Receives the bits of a read reply, in the order of their addresses.
#[derive(Debug)]
pub struct BitsOut<'a> {
    bytes: &'a mut [u8],
    next: u16,
    count: u16,
}

impl<'a> BitsOut<'a> {
    /// Prepares room for `count` bits, or fewer if `bytes` is shorter. All bits start as 0, including the padding.
    #[inline]
    pub fn new(bytes: &'a mut [u8], count: u16) -> Self {
        bytes.fill(0);
        Self {
            bytes,
            next: 0,
            count,
        }
    }

    /// Appends a bit. Bits without room are ignored.
    #[inline]
    pub fn push(&mut self, bit: bool) {
        if self.next < self.count {
            if let Some(byte) = self.bytes.get_mut(usize::from(self.next / 8)) {
                *byte |= u8::from(bit) << (self.next % 8);
            }
            self.next += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_count_limits_the_bits_and_hides_the_padding() {
        let bits = Bits::new(&[0b0000_0101, 0b1111_1110], 10);
        assert!(
            bits.iter()
                .eq([1, 0, 1, 0, 0, 0, 0, 0, 0, 1].map(|bit| bit == 1))
        );
        assert_eq!((bits.get(9), bits.get(10)), (Some(true), None));
    }

    #[test]
    fn bits_without_bytes_are_zero() {
        let bits = Bits::new(&[0xFF], 9);
        assert_eq!(bits.get(8), Some(false));
        assert_eq!(bits.iter().count(), 9);
    }

    #[test]
    fn too_many_or_too_few_pushed_bits_are_harmless() {
        let mut bytes = [0xFF; 3];
        let mut out = BitsOut::new(&mut bytes, 10);
        (0..12).for_each(|_| out.push(true));
        assert_eq!(bytes, [0xFF, 0b11, 0]);
        let mut out = BitsOut::new(&mut bytes, 24);
        out.push(true);
        assert_eq!(bytes, [1, 0, 0]);
        let mut out = BitsOut::new(&mut bytes[..1], 24);
        (0..24).for_each(|_| out.push(true));
        assert_eq!(bytes, [0xFF, 0, 0]);
    }
}
