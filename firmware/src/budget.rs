//! A budget of writes to the flash, which keeps a loop of them from wearing it out.

/// Number of writes that are possible now. It grows by one every `EVERY_S` seconds, up to `MOST`.
#[derive(Debug)]
pub struct Budget<const MOST: u8, const EVERY_S: u32> {
    left: u8,
    /// Time since the last one was added, in milliseconds.
    passed_ms: u32,
}

impl<const MOST: u8, const EVERY_S: u32> Budget<MOST, EVERY_S> {
    /// Returns a budget of `left` writes, at most `MOST`.
    #[must_use]
    pub const fn new(left: u8) -> Self {
        Self {
            left: if left < MOST { left } else { MOST },
            passed_ms: 0,
        }
    }

    /// Advances the time by `ms` milliseconds.
    pub const fn tick(&mut self, ms: u32) {
        if self.left >= MOST {
            self.passed_ms = 0;
            return;
        }
        self.passed_ms = self.passed_ms.saturating_add(ms);
        // A tick is shorter than this, so one write at most is due.
        if self.passed_ms >= EVERY_S * 1000 {
            self.passed_ms -= EVERY_S * 1000;
            self.left += 1;
        }
    }

    /// Returns the number of writes that are possible now.
    #[must_use]
    pub const fn left(&self) -> u8 {
        self.left
    }

    /// Uses one write up. Returns false when there is none.
    pub const fn take(&mut self) -> bool {
        if self.left == 0 {
            return false;
        }
        self.left -= 1;
        true
    }
}

#[cfg(test)]
mod tests {
    use register_map::configuration::{SAVE_EVERY_S, SAVES};

    use super::*;

    type Saves = Budget<SAVES, SAVE_EVERY_S>;

    fn taken(saves: &mut Saves) -> u32 {
        (0..100).map(|_| u32::from(saves.take())).sum()
    }

    #[test]
    fn twenty_saves_are_possible_together_and_then_one_a_minute() {
        let mut saves = Saves::new(SAVES);
        saves.tick(600_000);
        assert_eq!(taken(&mut saves), 20, "time adds none to a full budget");
        for _ in 0..3 {
            saves.tick(30_000);
            saves.tick(29_999);
            assert_eq!(taken(&mut saves), 0);
            saves.tick(1);
            assert_eq!(taken(&mut saves), 1);
        }
        (0..25).for_each(|_| saves.tick(60_000));
        assert_eq!(taken(&mut saves), 20);
    }

    #[test]
    fn budget_begins_with_the_saves_that_were_left_and_never_with_more_than_twenty() {
        assert_eq!(taken(&mut Saves::new(0)), 0);
        assert_eq!(taken(&mut Saves::new(7)), 7);
        assert_eq!(taken(&mut Saves::new(255)), 20);
    }
}
