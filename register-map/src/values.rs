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
    #[inline]
    #[must_use]
    pub fn allow(self, value: u16) -> bool {
        self.allow_all([value])
    }

    /// Returns whether the set contains all of these values. The kind of set is decided only once for all of them.
    #[inline]
    pub fn allow_all(self, values: impl IntoIterator<Item = u16>) -> bool {
        let mut values = values.into_iter();
        let (first, width) = match self {
            Self::Range { min, max } => (min, max.wrapping_sub(min)),
            // 0xFFFF in addition to a range from 0 is also a range when the values wrap.
            Self::RangeOr { also, min, max } if also.wrapping_add(1) == min => {
                (also, max.wrapping_sub(also))
            }
            Self::RangeOr { also, min, max } => {
                let width = max.wrapping_sub(min);
                return values.all(|value| value.wrapping_sub(min) <= width || value == also);
            }
            #[expect(
                clippy::manual_contains,
                reason = "`contains` takes 80 bytes more in the image"
            )]
            Self::OneOf(set) => return values.all(|value| set.iter().any(|one| *one == value)),
        };
        values.all(|value| value.wrapping_sub(first) <= width)
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

    #[test]
    fn one_bad_value_rejects_the_run() {
        let values = Values::range(2000, 5000);
        assert!(values.allow_all([2000, 3950, 5000]));
        assert!(!values.allow_all([2000, 1999, 5000]));
        assert!(!Values::OneOf(&[1, 3]).allow_all([1, 2, 3]));
        assert!(values.allow_all([]), "an empty run is allowed");
    }
}
