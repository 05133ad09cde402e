//! The lock of the configuration.

use register_map::configuration::OPEN_S;

/// Open for [`OPEN_S`] seconds after the last configuration write.
#[derive(Debug, Default)]
pub(super) struct Lock {
    left_ms: u32,
}

impl Lock {
    /// Closed, as at every start.
    pub(super) const fn closed() -> Self {
        Self { left_ms: 0 }
    }

    /// Opens it, or keeps it open, from now on.
    pub(super) const fn open(&mut self) {
        self.left_ms = OPEN_S * 1000;
    }

    /// Lets time pass.
    pub(super) const fn tick(&mut self, ms: u32) {
        self.left_ms = self.left_ms.saturating_sub(ms);
    }

    /// Whether it is open.
    pub(super) const fn is_open(&self) -> bool {
        self.left_ms > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_closes_sixty_seconds_after_it_was_opened_last() {
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
