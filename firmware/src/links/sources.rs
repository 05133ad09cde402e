//! The inputs of one port, as sources of links: whether they have a value, and their edges.
//!
//! ```text
//!   power-on, a change of settings        1 s   \
//!   any other reset, an analog input      1 s    > then it has a value, while it is good
//!   any other reset, a digital input      0     /
//!   it was not good                      60 s
//! ```
//!
//! A digital input waits for its debounce as well. So neither a contact that is closed when the power returns is an
//! edge, nor a supply of 24 V that comes later than that of the unit, nor does a transmitter count that starts at 0 mA.

use modio_drivers::{CHANNELS, ChannelSettings};

use super::plausible::Plausible;

/// Time in ms from a power-on, or from a change of its settings, until a source has a value.
pub const AFTER_POWER_ON_MS: u16 = 1_000;

/// Time in ms until a source that was not good has a value again.
pub const AFTER_A_FAULT_MS: u16 = 60_000;

/// The inputs of a port. Masks have channel 1 in bit 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sources {
    /// Time in ms until each has a value.
    waits: [u16; CHANNELS],
    /// Channels that wait, or are not good.
    waiting: u8,
    /// Channels that are not good.
    bad: u8,
    /// Digital inputs that had another value in the scan before the last one.
    edges: u8,
    /// The codes of analog inputs.
    codes: [Plausible; CHANNELS],
}

impl Sources {
    /// Returns sources that are good and have values.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            waits: [0; CHANNELS],
            waiting: 0,
            bad: 0,
            edges: 0,
            codes: [const { Plausible::new() }; CHANNELS],
        }
    }

    /// Makes a source begin again: it has a value after this time in ms, if it is good then.
    pub const fn begin(&mut self, channel: usize, wait_ms: u16) {
        if channel < CHANNELS {
            self.waits[channel] = wait_ms;
            self.waiting |= 1 << channel;
            self.edges &= !(1 << channel);
            self.codes[channel] = Plausible::new();
        }
    }

    /// Adds the code of an analog input, before [`scanned`](Self::scanned) for the same scan.
    pub fn add_code(&mut self, channel: usize, code: u16, settings: &ChannelSettings) {
        if let Some(codes) = self.codes.get_mut(channel) {
            codes.add(code, settings);
        }
    }

    /// Stores a scan, `ms` milliseconds after the one before: the channels that cannot be read, and those whose level has
    /// changed.
    pub fn scanned(&mut self, failing: u8, changed: u8, ms: u32) {
        let before = self.waiting;
        self.bad = failing;
        for (channel, codes) in self.codes.iter().enumerate() {
            self.bad |= u8::from(codes.is_bad()) << channel;
        }
        self.waiting |= self.bad;
        if self.waiting != 0 {
            self.wait(ms);
        }
        // Of the level before its first value a source knows nothing.
        self.edges = changed & !(before | self.waiting);
    }

    fn wait(&mut self, ms: u32) {
        for (channel, wait) in self.waits.iter_mut().enumerate() {
            let mask = 1 << channel;
            if self.bad & mask != 0 {
                *wait = AFTER_A_FAULT_MS;
            } else if *wait == 0 {
                self.waiting &= !mask;
            } else {
                *wait = u32::from(*wait).saturating_sub(ms) as u16;
            }
        }
    }

    /// Returns whether a source has a value.
    #[must_use]
    pub const fn has_value(&self, channel: usize) -> bool {
        self.waiting >> (channel & 7) & 1 == 0
    }

    /// Returns whether a source is good. It may still wait for its value.
    #[must_use]
    pub const fn is_good(&self, channel: usize) -> bool {
        self.bad >> (channel & 7) & 1 == 0
    }

    /// Returns whether the last codes of an analog input make its value uncertain, although it is good.
    #[must_use]
    pub fn is_uncertain(&self, channel: usize) -> bool {
        self.codes
            .get(channel)
            .is_some_and(|codes| !codes.is_good())
    }

    /// Returns whether a digital input changed between its values in the last two scans.
    #[must_use]
    pub const fn has_edge(&self, channel: usize) -> bool {
        self.edges >> (channel & 7) & 1 != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn source_has_a_value_after_its_wait_and_an_edge_needs_two_values() {
        let mut sources = Sources::new();
        sources.begin(1, 3);
        for _ in 0..3 {
            sources.scanned(0, 0b1111, 1);
            assert!(!sources.has_value(1) && sources.is_good(1));
        }
        sources.scanned(0, 0b0010, 1);
        assert!(sources.has_value(1) && !sources.has_edge(1), "the first");
        sources.scanned(0, 0b0010, 1);
        assert!(sources.has_edge(1) && !sources.has_edge(0));
        sources.scanned(0, 0, 1);
        assert!(!sources.has_edge(1));
    }

    #[test]
    fn source_that_was_not_good_has_a_value_after_a_minute() {
        let mut sources = Sources::new();
        sources.scanned(0, 0, 1);
        assert!(sources.has_value(2));
        sources.scanned(0b0100, 0b0100, 1);
        assert!(!sources.has_value(2) && !sources.is_good(2) && !sources.has_edge(2));
        // Scans that are late count with their time.
        sources.scanned(0, 0, 59_999);
        sources.scanned(0, 0, 1);
        assert!(!sources.has_value(2) && sources.is_good(2));
        sources.scanned(0, 0, 1);
        assert!(sources.has_value(2));
    }
}
