//! The filter of a digital input.

use register_map::limits::DEBOUNCE_MAX_MS;

/// Debounces a level. A new level counts after it was seen in `needed` samples in a row; with 0 it counts
/// immediately. The first sample counts immediately. Shorter pulses are suppressed, and both edges are delayed
/// equally.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Debounce {
    /// Number of samples that a new level needs before it counts.
    needed: u16,
    /// Number of samples with the new level so far.
    seen: u16,
    /// The level that counts; none before the first sample.
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

    /// Sets the samples needed, at most [`DEBOUNCE_MAX_MS`]. The samples seen so far still count.
    pub(crate) fn set_needed(&mut self, needed: u16) {
        self.needed = needed.min(DEBOUNCE_MAX_MS);
    }

    /// Adds a sample and returns the level that counts.
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
    fn a_new_length_counts_samples_seen_before() {
        let mut filter = Debounce::new(10);
        assert!(!filter.sample(false));
        assert!(!feed(&mut filter, true, 6));
        filter.set_needed(10);
        assert!(!feed(&mut filter, true, 3), "nine of ten samples");
        assert!(
            filter.sample(true),
            "setting the same length does not disturb"
        );

        assert!(feed(&mut filter, false, 6));
        filter.set_needed(8);
        assert!(filter.sample(false), "seven of eight samples");
        assert!(!filter.sample(false));

        assert!(!feed(&mut filter, true, 6));
        filter.set_needed(2);
        assert!(filter.sample(true), "seven samples are more than two");
    }

    #[test]
    fn a_length_above_the_maximum_becomes_the_maximum() {
        let mut filter = Debounce::new(0);
        filter.set_needed(u16::MAX);
        assert!(!filter.sample(false));
        assert!(!feed(&mut filter, true, DEBOUNCE_MAX_MS - 1));
        assert!(filter.sample(true));
    }
}
