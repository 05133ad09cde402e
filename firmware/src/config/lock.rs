//! The lock that protects the configuration from writes.

use register_map::configuration::OPEN_S;

/// A lock that stays open for [`OPEN_S`] seconds after the last configuration write.
#[derive(Debug, Default)]
pub(super) struct Lock {
    left_ms: u32,
}

impl Lock {
    /// Returns a closed lock, as at every start.
    pub(super) const fn closed() -> Self {
        Self { left_ms: 0 }
    }

    /// Opens the lock, or keeps it open.
    pub(super) const fn open(&mut self) {
        self.left_ms = OPEN_S * 1000;
    }

    /// Advances the time by `ms` milliseconds.
    pub(super) const fn tick(&mut self, ms: u32) {
        self.left_ms = self.left_ms.saturating_sub(ms);
    }

    /// Returns whether the lock is open.
    pub(super) const fn is_open(&self) -> bool {
        self.left_ms > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lock_closes_sixty_seconds_after_the_last_opening() {
        let mut lock = Lock::closed();
        assert!(!lock.is_open());
        lock.open();
        lock.tick(59_999);
        assert!(lock.is_open());
        lock.open();
        lock.tick(59_999);
        assert!(lock.is_open());
        lock.tick(1);
        assert!(!lock.is_open());
        lock.tick(u32::MAX);
        assert!(!lock.is_open());
    }
}
