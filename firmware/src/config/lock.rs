//! The lock that protects the configuration from writes.

use register_map::configuration::OPEN_S;

use super::LineName;

/// A lock that stays open for [`OPEN_S`] seconds after the last configuration write, for the line that opened it. Closed by
/// default.
#[derive(Debug, Default)]
pub(super) struct Lock {
    left_ms: u32,
    owner: LineName,
}

impl Lock {
    /// Opens the lock for a line, or keeps it open. It closes for every other line.
    pub(super) const fn open(&mut self, line: LineName) {
        self.left_ms = OPEN_S * 1000;
        self.owner = line;
    }

    /// Advances the time by `ms` milliseconds.
    pub(super) const fn tick(&mut self, ms: u32) {
        self.left_ms = self.left_ms.saturating_sub(ms);
    }

    /// Returns whether the lock is open for requests over this line.
    pub(super) const fn is_open(&self, line: LineName) -> bool {
        self.left_ms > 0 && self.owner as u8 == line as u8
    }
}

#[cfg(test)]
mod tests {
    use super::LineName::{Rs485, Second};
    use super::*;

    #[test]
    fn the_lock_closes_sixty_seconds_after_the_last_opening() {
        let mut lock = Lock::default();
        assert!(!lock.is_open(Rs485));
        lock.open(Rs485);
        lock.tick(59_999);
        assert!(lock.is_open(Rs485));
        lock.open(Rs485);
        lock.tick(59_999);
        assert!(lock.is_open(Rs485));
        lock.tick(1);
        assert!(!lock.is_open(Rs485));
        lock.tick(u32::MAX);
        assert!(!lock.is_open(Rs485));
    }

    #[test]
    fn the_lock_is_open_for_the_line_that_opened_it_last() {
        let mut lock = Lock::default();
        lock.open(Second);
        assert!(lock.is_open(Second) && !lock.is_open(Rs485));
        lock.tick(59_999);
        lock.open(Rs485);
        assert!(lock.is_open(Rs485) && !lock.is_open(Second));
        lock.tick(59_999);
        assert!(lock.is_open(Rs485));
    }
}
