//! The filter of a digital input.

/// Debounce of every input until told otherwise, in milliseconds.
pub const DEBOUNCE_DEFAULT_MS: u16 = 5;

/// The longest debounce, in milliseconds.
pub const DEBOUNCE_MAX_MS: u16 = 1000;

/// A level counts as changed when it has stood in every one of as many samples as are needed; with 0
/// it is followed at once. The first sample counts as it stands. A pulse shorter than that is not
/// seen, and both edges are delayed alike.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Debounce {
    /// Samples a new level must stand before it counts.
    needed: u16,
    /// Samples the new level has stood so far.
    seen: u16,
    /// The level that counts, none before the first sample.
    level: Option<bool>,
}

impl Debounce {
    pub(crate) const fn new(needed: u16) -> Self {
        Self {
            needed,
            seen: 0,
            level: None,
        }
    }

    /// Sets the samples needed, at most [`DEBOUNCE_MAX_MS`]. A level on its way in keeps what it has.
    pub(crate) fn set_needed(&mut self, needed: u16) {
        self.needed = needed.min(DEBOUNCE_MAX_MS);
    }

    /// Takes a sample and returns the level that counts.
    pub(crate) fn sample(&mut self, now: bool) -> bool {
        let level = self.level.unwrap_or(now);
        self.seen = if now == level {
            0
        } else {
            self.seen.saturating_add(1)
        };
        let changed = self.seen > 0 && self.seen >= self.needed;
        if changed {
            self.seen = 0;
        }
        let level = level != changed;
        self.level = Some(level);
        level
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn feed(filter: &mut Debounce, level: bool, samples: u16) -> bool {
        (0..samples).fold(level, |_, _| filter.sample(level))
    }

    #[test]
    fn a_new_length_counts_what_has_been_seen_already() {
        let mut filter = Debounce::new(10);
        assert!(!filter.sample(false));
        assert!(!feed(&mut filter, true, 6));
        filter.set_needed(10);
        assert!(!feed(&mut filter, true, 3), "nine of ten");
        assert!(filter.sample(true), "the same again disturbs nothing");

        assert!(feed(&mut filter, false, 6));
        filter.set_needed(8);
        assert!(filter.sample(false), "seven of eight");
        assert!(!filter.sample(false));

        assert!(!feed(&mut filter, true, 6));
        filter.set_needed(2);
        assert!(filter.sample(true), "seven are more than two");
    }

    #[test]
    fn a_length_beyond_the_longest_is_the_longest() {
        let mut filter = Debounce::new(0);
        filter.set_needed(u16::MAX);
        assert!(!filter.sample(false));
        assert!(!feed(&mut filter, true, DEBOUNCE_MAX_MS - 1));
        assert!(filter.sample(true));
    }
}
