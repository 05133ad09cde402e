//! Sets of values that a register allows.

/// A set of 16-bit values, small enough to be checked in a few instructions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Values {
    /// `min` to `max`, both included.
    Range {
        /// Smallest value.
        min: u16,
        /// Largest value, not below `min`.
        max: u16,
    },
    /// `also`, or `min` to `max`.
    RangeOr {
        /// A value outside the range, such as off or hold.
        also: u16,
        /// Smallest value of the range.
        min: u16,
        /// Largest value of the range, not below `min`.
        max: u16,
    },
    /// These values, in ascending order.
    OneOf(&'static [u16]),
}

impl Values {
    /// Every value.
    pub const ANY: Self = Self::up_to(0xFFFF);

    /// Returns the values from 0 to `max`.
    #[must_use]
    pub const fn up_to(max: u16) -> Self {
        Self::Range { min: 0, max }
    }

    /// Returns the values from `min` to `max`.
    #[must_use]
    pub const fn range(min: u16, max: u16) -> Self {
        Self::Range { min, max }
    }

    /// Returns a single value.
    #[must_use]
    pub const fn only(value: u16) -> Self {
        Self::range(value, value)
    }

    /// Returns this range with `also` as an additional value.
    #[must_use]
    pub const fn or(self, also: u16) -> Self {
        match self {
            Self::Range { min, max } | Self::RangeOr { min, max, .. } => {
                Self::RangeOr { also, min, max }
            }
            Self::OneOf(_) => self,
        }
    }

    /// Returns whether the set contains this value.
    #[must_use]
    #[expect(
        clippy::manual_contains,
        reason = "`contains` takes 68 bytes more in the image"
    )]
    pub fn allow(&self, value: u16) -> bool {
        match *self {
            Self::Range { min, max } => min <= value && value <= max,
            Self::RangeOr { also, min, max } => value == also || min <= value && value <= max,
            Self::OneOf(values) => values.iter().any(|one| *one == value),
        }
    }

    /// Returns whether the set contains all of these values. Faster than [`Self::allow`] for each of them.
    #[inline]
    pub fn allow_all(&self, mut values: impl Iterator<Item = u16>) -> bool {
        let (also, min, max) = match *self {
            Self::Range { min, max } => (min, min, max),
            Self::RangeOr { also, min, max } => (also, min, max),
            Self::OneOf(_) => return values.all(|value| self.allow(value)),
        };
        values.all(|value| value == also || min <= value && value <= max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allowed(values: Values) -> impl Iterator<Item = u16> {
        (0..=0xFFFF).filter(move |value| values.allow(*value))
    }

    #[test]
    fn exactly_the_values_of_the_set_are_allowed() {
        assert!(allowed(Values::range(5, 9)).eq(5..=9));
        assert!(allowed(Values::range(5, 7).or(0)).eq([0, 5, 6, 7]));
        assert!(allowed(Values::up_to(1).or(0xFFFF)).eq([0, 1, 0xFFFF]));
        assert!(allowed(Values::only(0x5A17)).eq([0x5A17]));
        assert!(allowed(Values::OneOf(&[12, 24])).eq([12, 24]));
        assert_eq!(allowed(Values::ANY).count(), 0x1_0000);
    }
}
