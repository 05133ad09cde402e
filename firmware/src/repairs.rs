//! Counts repairs of disturbed registers, and decides when a restart is needed instead.
//!
//! One disturbance may need several repairs: a block that was reset by a disturbed bit has lost all its registers,
//! which are found one after another. Repairs that follow each other closely therefore count as one.

/// Milliseconds without a repair after which the next repair is a new one. After a repair of a clock or a reset the checks
/// begin at the first row, so all that this disturbance has changed is found within fewer.
const QUIET_MS: u8 = 40;
/// Number of repairs that may follow each other closely. More mean that repairs do not help.
const MOST: u8 = 16;

/// The recent repairs.
pub struct Repairs {
    /// Milliseconds since the last repair, at most [`QUIET_MS`].
    quiet_ms: u8,
    /// Number of repairs that followed each other closely.
    close: u8,
}

impl Default for Repairs {
    fn default() -> Self {
        Self {
            quiet_ms: QUIET_MS,
            close: 0,
        }
    }
}

impl Repairs {
    /// Ends a millisecond in which something was repaired, or not. Returns whether this is a new repair.
    #[inline(always)]
    pub fn end_millisecond(&mut self, repaired: bool) -> bool {
        let is_quiet = self.quiet_ms == QUIET_MS;
        if is_quiet {
            self.close = 0;
        } else {
            self.quiet_ms += 1;
        }
        if repaired {
            self.quiet_ms = 0;
            self.close = self.close.saturating_add(1);
        }
        repaired && is_quiet
    }

    /// Returns whether the repairs help. If they do not, the device must be restarted.
    #[inline(always)]
    #[must_use]
    pub const fn help(&self) -> bool {
        self.close <= MOST
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn close_repairs_count_once_and_too_many_of_them_do_not_help() {
        let mut repairs = Repairs::default();
        let mut after = |ms| {
            (1..ms).for_each(|_| assert!(!repairs.end_millisecond(false)));
            let is_new = repairs.end_millisecond(true);
            (is_new, repairs.help())
        };
        assert_eq!(after(1), (true, true));
        assert_eq!(after(QUIET_MS), (false, true));
        assert_eq!(after(QUIET_MS + 1), (true, true));
        for _ in 1..MOST {
            assert_eq!(after(4), (false, true));
        }
        assert_eq!(after(4), (false, false));
        assert_eq!(after(QUIET_MS + 1), (true, true));
    }
}
