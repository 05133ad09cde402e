//! The unit addresses of a line (V1.02 2.2).

/// The unit addresses whose requests a [`Receiver`](super::Receiver) takes: a `u8` for a single one, a [`UnitSet`], or a
/// [`FastUnit`].
pub trait Units {
    /// Lines can recognise messages of Fast Modbus ([`fast`](crate::fast)) at their last byte. Costs nothing when
    /// `false`.
    const FAST: bool = false;

    /// Returns whether requests to this unit address are taken.
    fn contains(&self, unit: u8) -> bool;

    /// Returns whether messages of Fast Modbus are recognised on this line.
    fn is_fast(&self) -> bool {
        Self::FAST
    }

    /// Returns whether broadcasts are taken.
    fn takes_broadcasts(&self) -> bool {
        true
    }
}

impl Units for u8 {
    #[inline(always)]
    fn contains(&self, unit: u8) -> bool {
        *self == unit
    }
}

/// The unit address of a unit that serves [Fast Modbus](crate::fast), on an RTU line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FastUnit {
    /// `None` for a unit without an address. It takes requests to [`fast::ADDRESS`](crate::fast::ADDRESS) only, so that
    /// it can be found.
    pub unit: Option<u8>,
    /// Whether messages of Fast Modbus are recognised, and requests to [`fast::ADDRESS`](crate::fast::ADDRESS) taken. Not
    /// on an ASCII line.
    pub is_fast: bool,
}

impl Units for FastUnit {
    const FAST: bool = true;

    #[inline(always)]
    fn contains(&self, unit: u8) -> bool {
        self.unit == Some(unit) || self.is_fast && unit == crate::fast::ADDRESS
    }

    #[inline(always)]
    fn is_fast(&self) -> bool {
        self.is_fast
    }

    #[inline(always)]
    fn takes_broadcasts(&self) -> bool {
        self.unit.is_some()
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
    /// Creates the set of these addresses: 1-247, or 248-255, which the standard leaves to the device.
    #[must_use]
    pub const fn new(units: &[u8]) -> Self {
        let mut words = [0; 8];
        let mut rest = units;
        while let [unit, others @ ..] = rest {
            // There are eight words, so the compiler removes the bounds check.
            words[(*unit / 32) as usize] |= 1 << (*unit % 32);
            rest = others;
        }
        Self(words)
    }
}

impl Units for UnitSet {
    #[inline(always)]
    fn contains(&self, unit: u8) -> bool {
        // There are eight words, so the compiler removes the bounds check.
        let word = self.0.get(usize::from(unit / 32));
        word.is_some_and(|word| word >> (unit % 32) & 1 != 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn set_contains_exactly_its_addresses() {
        let units = [1, 31, 32, 64, 247, 255];
        let set = UnitSet::new(&units);
        for unit in 0..=255 {
            assert_eq!(set.contains(unit), units.contains(&unit), "{unit}");
        }
        assert_eq!(UnitSet::new(&[]), UnitSet::default());
    }
}
