//! Virtual time: whole picoseconds since the chip was made.
//!
//! A picosecond divides every clock of the part finely enough that an instant computed from a whole
//! number of cycles is off by less than one picosecond, and it never drifts as long as it is computed
//! as `base + Time::cycles(n, hz)` with a growing `n`. 64 bits last 213 days.

use core::fmt;
use core::ops::{Add, AddAssign, Mul, Sub, SubAssign};

/// Picoseconds in a second.
const PS_PER_S: u64 = 1_000_000_000_000;

/// An instant (since the chip was made) or a span, in picoseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Time(u64);

impl Time {
    /// The instant the chip was made; an empty span.
    pub const ZERO: Self = Self(0);
    /// Later than anything that happens: 213 days.
    pub const MAX: Self = Self(u64::MAX);

    /// Returns a span of picoseconds.
    #[must_use]
    pub const fn from_ps(ps: u64) -> Self {
        Self(ps)
    }

    /// Returns a span of nanoseconds; saturates at [`Time::MAX`], as all the others do.
    #[must_use]
    pub const fn from_ns(ns: u64) -> Self {
        Self(ns.saturating_mul(1_000))
    }

    /// Returns a span of microseconds.
    #[must_use]
    pub const fn from_us(us: u64) -> Self {
        Self(us.saturating_mul(1_000_000))
    }

    /// Returns a span of milliseconds.
    #[must_use]
    pub const fn from_ms(ms: u64) -> Self {
        Self(ms.saturating_mul(1_000_000_000))
    }

    /// Returns a span of seconds.
    #[must_use]
    pub const fn from_secs(s: u64) -> Self {
        Self(s.saturating_mul(PS_PER_S))
    }

    /// Returns the span of `n` cycles of a clock of `hz` Hz, rounded down to the picosecond. A clock of 0 Hz never gets
    /// there: [`Time::MAX`].
    #[must_use]
    pub const fn cycles(n: u64, hz: u32) -> Self {
        if hz == 0 {
            return Self::MAX;
        }
        // The common case fits 64 bits; the other is exact all the same.
        if let Some(product) = n.checked_mul(PS_PER_S) {
            return Self(product / hz as u64);
        }
        let ps = n as u128 * PS_PER_S as u128 / hz as u128;
        if ps > u64::MAX as u128 {
            Self::MAX
        } else {
            Self(ps as u64)
        }
    }

    /// Returns how many whole cycles of a clock of `hz` Hz have ended in this span: the inverse of [`Time::cycles`], so
    /// `Time::cycles(n, hz).in_cycles(hz) == n` for every `n` that fits.
    #[must_use]
    pub const fn in_cycles(self, hz: u32) -> u64 {
        // `cycles` rounds down, so the last picosecond of cycle n - 1 already counts as cycle n:
        // floor(((ps + 1) * hz - 1) / 1e12) undoes exactly that.
        if hz == 0 {
            return 0;
        }
        (((self.0 as u128 + 1) * hz as u128 - 1) / PS_PER_S as u128) as u64
    }

    /// Returns the span in picoseconds.
    #[must_use]
    pub const fn as_ps(self) -> u64 {
        self.0
    }

    /// Returns the span in whole nanoseconds, rounded down.
    #[must_use]
    pub const fn as_ns(self) -> u64 {
        self.0 / 1_000
    }

    /// Returns the span in whole microseconds, rounded down.
    #[must_use]
    pub const fn as_us(self) -> u64 {
        self.0 / 1_000_000
    }

    /// Returns the span in whole milliseconds, rounded down.
    #[must_use]
    pub const fn as_ms(self) -> u64 {
        self.0 / 1_000_000_000
    }

    /// Returns the span in seconds, for people to read.
    #[must_use]
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 / PS_PER_S as f64
    }

    /// Returns the sum, or `None` past the end of time.
    #[must_use]
    pub const fn checked_add(self, span: Self) -> Option<Self> {
        match self.0.checked_add(span.0) {
            Some(ps) => Some(Self(ps)),
            None => None,
        }
    }

    /// Returns the difference, or `None` when `earlier` is later.
    #[must_use]
    pub const fn checked_sub(self, earlier: Self) -> Option<Self> {
        match self.0.checked_sub(earlier.0) {
            Some(ps) => Some(Self(ps)),
            None => None,
        }
    }

    /// Returns the difference, or an empty span when `earlier` is later.
    #[must_use]
    pub const fn saturating_sub(self, earlier: Self) -> Self {
        Self(self.0.saturating_sub(earlier.0))
    }
}

impl Add for Time {
    type Output = Self;
    /// Saturates at [`Time::MAX`], so that "never" plus a span stays "never".
    fn add(self, span: Self) -> Self {
        Self(self.0.saturating_add(span.0))
    }
}

impl AddAssign for Time {
    fn add_assign(&mut self, span: Self) {
        *self = *self + span;
    }
}

impl Sub for Time {
    type Output = Self;
    /// Saturates at zero in a release build; an error of the model that a debug build catches.
    fn sub(self, earlier: Self) -> Self {
        debug_assert!(self >= earlier, "{self} - {earlier}");
        self.saturating_sub(earlier)
    }
}

impl SubAssign for Time {
    fn sub_assign(&mut self, earlier: Self) {
        *self = *self - earlier;
    }
}

impl Mul<u64> for Time {
    type Output = Self;
    fn mul(self, times: u64) -> Self {
        Self(self.0.saturating_mul(times))
    }
}

impl fmt::Display for Time {
    /// Seconds to the microsecond, such as `1.250003 s`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let us = self.as_us();
        write!(f, "{}.{:06} s", us / 1_000_000, us % 1_000_000)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_are_exact_over_days() {
        // 72 MHz does not divide a picosecond count evenly: 13 888.88 ps a cycle.
        assert_eq!(Time::cycles(9, 72_000_000).as_ps(), 125_000);
        assert_eq!(
            Time::cycles(72_000_000 * 86_400, 72_000_000),
            Time::from_secs(86_400)
        );
        assert_eq!(Time::cycles(u64::MAX, 1), Time::MAX);
        assert_eq!(Time::cycles(1, 0), Time::MAX);
    }

    #[test]
    fn cycles_convert_back_to_the_same_number() {
        for hz in [1, 7, 40_000, 8_000_000, 36_000_000, 72_000_000] {
            for n in [0, 1, 2, 3, 1_000, 999_999, 123_456_789] {
                if n / u64::from(hz) < 1_000_000 {
                    assert_eq!(Time::cycles(n, hz).in_cycles(hz), n, "{n} at {hz} Hz");
                }
                if n > 0 && n / u64::from(hz) < 1_000_000 {
                    let before = Time::cycles(n, hz) - Time::from_ps(1);
                    assert_eq!(before.in_cycles(hz), n - 1, "just before {n} at {hz} Hz");
                }
            }
        }
    }

    #[test]
    fn never_stays_never() {
        assert_eq!(Time::MAX + Time::from_us(1), Time::MAX);
        assert_eq!(Time::from_us(1).checked_sub(Time::from_us(2)), None);
        assert_eq!(Time::from_us(1_250_003).to_string(), "1.250003 s");
    }
}
