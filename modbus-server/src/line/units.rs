//! The unit addresses of a line (V1.02 2.2).

/// The unit addresses whose requests a [`Receiver`](super::Receiver) takes: a `u8` for a single one, or a [`UnitSet`].
pub trait Units {
    /// Whether requests to this unit address are taken. All broadcasts are.
    fn contains(&self, unit: u8) -> bool;
}

impl Units for u8 {
    #[inline(always)]
    fn contains(&self, unit: u8) -> bool {
        *self == unit
    }
}

/// A set of unit addresses, as a map of 256 bits.
///
/// ```
/// use modbus_server::line::{UnitSet, Units};
///
/// const UNITS: UnitSet = UnitSet::new(&[17, 18, 247]);
/// assert!(UNITS.contains(17) && !UNITS.contains(19));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UnitSet([u32; 8]);

impl UnitSet {
    /// The set of these addresses: 1-247, or 248-255, which the standard leaves to the device.
    #[must_use]
    pub const fn new(units: &[u8]) -> Self {
        let mut words = [0; 8];
        let mut rest = units;
        while let [unit, others @ ..] = rest {
            // Of eight words: no check is left of this.
            words[(*unit / 32) as usize] |= 1 << (*unit % 32);
            rest = others;
        }
        Self(words)
    }
}

impl Units for UnitSet {
    #[inline(always)]
    fn contains(&self, unit: u8) -> bool {
        // Of eight words: no check is left of this.
        let word = self.0.get(usize::from(unit / 32));
        word.is_some_and(|word| word >> (unit % 32) & 1 != 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn set_contains_the_addresses_it_was_made_of() {
        let units = [1, 31, 32, 64, 247, 255];
        let set = UnitSet::new(&units);
        for unit in 0..=255 {
            assert_eq!(set.contains(unit), units.contains(&unit), "{unit}");
        }
        assert_eq!(UnitSet::new(&[]), UnitSet::default());
    }
}
