//! The four channels of one module as the rest of the device sees them.

/// Channels of a module.
pub const CHANNELS: usize = 4;

/// What a channel is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Nothing: no point stands at its address.
    None,
    /// A digital input.
    BitInput,
    /// A digital output.
    BitOutput,
}

/// What stands in a module's channels: inputs as last scanned, outputs as commanded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Channels {
    /// Digital channels, channel 1 in bit 0.
    bits: u8,
}

impl Channels {
    /// Everything off.
    #[must_use]
    pub const fn new() -> Self {
        Self { bits: 0 }
    }

    /// A digital channel, 0 to 3; `false` for a channel that does not exist.
    #[must_use]
    pub const fn bit(&self, channel: usize) -> bool {
        channel < CHANNELS && self.bits & (1 << channel) != 0
    }

    /// Sets a digital channel, 0 to 3; one that does not exist is left alone.
    pub const fn set_bit(&mut self, channel: usize, value: bool) {
        if channel < CHANNELS {
            let mask = 1 << channel;
            self.bits = if value {
                self.bits | mask
            } else {
                self.bits & !mask
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_kept_apart_and_a_fifth_channel_is_nothing() {
        let mut channels = Channels::new();
        channels.set_bit(0, true);
        channels.set_bit(3, true);
        channels.set_bit(4, true);
        let read = |c: &Channels| [c.bit(0), c.bit(1), c.bit(2), c.bit(3), c.bit(4)];
        assert_eq!(read(&channels), [true, false, false, true, false]);
        channels.set_bit(0, false);
        assert_eq!(read(&channels), [false, false, false, true, false]);
    }
}
