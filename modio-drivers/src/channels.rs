//! The four channels of one module, as the rest of the device accesses them.

use crate::ChannelStatus;

/// Number of channels of a module.
pub const CHANNELS: usize = 4;

/// The values of a module's channels: inputs as last scanned, outputs as commanded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Channels {
    /// Digital channels, channel 1 in bit 0.
    bits: u8,
    words: [u16; CHANNELS],
    status: [ChannelStatus; CHANNELS],
}

impl Channels {
    /// Returns channels that are all off, 0 and good.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            bits: 0,
            words: [0; CHANNELS],
            status: [ChannelStatus::Good; CHANNELS],
        }
    }

    /// Returns a digital channel, 0 to 3; `false` for a channel that does not exist.
    #[must_use]
    pub const fn bit(&self, channel: usize) -> bool {
        channel < CHANNELS && self.bits & (1 << channel) != 0
    }

    /// Sets a digital channel, 0 to 3. A channel that does not exist is ignored.
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

    /// Returns the digital channels, channel 1 in bit 0.
    #[must_use]
    pub const fn bits(&self) -> u8 {
        self.bits
    }

    /// Sets the digital channels of a mask to those of `values`, channel 1 in bit 0.
    pub const fn set_bits(&mut self, mask: u8, values: u8) {
        self.bits = self.bits & !mask | values & mask;
    }

    /// Returns an analog channel, 0 to 3, in the unit of its [`Scale`](crate::Scale); 0 for a channel that does not
    /// exist.
    #[must_use]
    pub const fn word(&self, channel: usize) -> u16 {
        if channel < CHANNELS {
            self.words[channel]
        } else {
            0
        }
    }

    /// Sets an analog channel, 0 to 3. A channel that does not exist is ignored.
    pub const fn set_word(&mut self, channel: usize, value: u16) {
        if channel < CHANNELS {
            self.words[channel] = value;
        }
    }

    /// Returns the status of a channel, 0 to 3; good for a channel that does not exist.
    #[must_use]
    pub const fn status(&self, channel: usize) -> ChannelStatus {
        if channel < CHANNELS {
            self.status[channel]
        } else {
            ChannelStatus::Good
        }
    }

    /// Sets the status of a channel, 0 to 3. A channel that does not exist is ignored.
    pub const fn set_status(&mut self, channel: usize, status: ChannelStatus) {
        if channel < CHANNELS {
            self.status[channel] = status;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_independent_and_a_fifth_channel_is_ignored() {
        let mut channels = Channels::new();
        channels.set_bit(0, true);
        channels.set_bit(3, true);
        channels.set_bit(4, true);
        let read = |c: &Channels| [c.bit(0), c.bit(1), c.bit(2), c.bit(3), c.bit(4)];
        assert_eq!(read(&channels), [true, false, false, true, false]);
        channels.set_bit(0, false);
        assert_eq!(read(&channels), [false, false, false, true, false]);
    }

    #[test]
    fn words_and_status_are_independent_and_a_fifth_channel_is_ignored() {
        let mut channels = Channels::new();
        for channel in 0..5 {
            channels.set_word(channel, 100 + channel as u16);
        }
        channels.set_status(1, ChannelStatus::OpenCircuit);
        channels.set_status(4, ChannelStatus::OverRange);
        assert_eq!(
            [0, 1, 2, 3, 4].map(|c| channels.word(c)),
            [100, 101, 102, 103, 0]
        );
        assert_eq!(
            [0, 1, 2, 3, 4].map(|c| channels.status(c).code()),
            [0, 3, 0, 0, 0]
        );
    }

    #[test]
    fn status_codes_are_those_of_the_register_map() {
        use ChannelStatus::{Good, OpenCircuit, OverRange, ShortCircuit, UnderRange};
        let all = [Good, UnderRange, OverRange, OpenCircuit, ShortCircuit];
        assert_eq!(all.map(ChannelStatus::code), [0, 1, 2, 3, 4]);
    }
}
