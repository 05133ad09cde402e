//! What every module's driver can do.

use crate::{CHANNELS, ChannelSettings, Channels, Kind};

/// Channels of a module that could not be read or driven. They keep what they had, and are tried again at every
/// scan. All other channels have been served.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModuleError {
    /// Channels whose own line of the slot failed, channel 1 in bit 0.
    lines: u8,
    /// Channels whose chip on the module does not answer, channel 1 in bit 0.
    chip: u8,
}

impl ModuleError {
    /// A line of the slot could not be read or driven: that of this channel, 0 to 3.
    #[must_use]
    pub const fn line(channel: usize) -> Self {
        Self {
            lines: 1 << (channel % CHANNELS),
            chip: 0,
        }
    }

    /// The module's chip, which serves these channels, channel 1 in bit 0, does not answer.
    #[must_use]
    pub const fn chip(channels: u8) -> Self {
        Self {
            lines: 0,
            chip: channels,
        }
    }

    /// Every channel that failed, channel 1 in bit 0.
    #[must_use]
    pub const fn channels(self) -> u8 {
        self.lines | self.chip
    }

    /// The first channel, 0 to 3, whose own line failed, when the module's chip answers.
    #[must_use]
    pub const fn first_line(self) -> Option<usize> {
        if self.chip == 0 && self.lines != 0 {
            Some(self.lines.trailing_zeros() as usize)
        } else {
            None
        }
    }

    /// What failed in either of two results.
    ///
    /// # Errors
    ///
    /// The channels of both.
    pub const fn in_either(one: Result<(), Self>, other: Result<(), Self>) -> Result<(), Self> {
        match (one, other) {
            (Err(one), Err(other)) => Err(Self {
                lines: one.lines | other.lines,
                chip: one.chip | other.chip,
            }),
            (Err(error), Ok(())) | (Ok(()), Err(error)) => Err(error),
            (Ok(()), Ok(())) => Ok(()),
        }
    }
}

/// A plug-in module in its slot.
pub trait IoModule {
    /// What each of the four channels is. Never changes while the module is in use.
    fn kinds(&self) -> [Kind; CHANNELS];

    /// Sets how each channel is to be read or driven, in force from the next scan on. May come at any
    /// time between two scans. A channel whose settings have not changed is not disturbed: a debounce
    /// goes on, a filter keeps its state.
    ///
    /// Settings a channel has no use for are ignored, and one outside its range counts as the nearest
    /// within. Until the first call, [`ChannelSettings::default_for`] is in force.
    fn configure(&mut self, settings: &[ChannelSettings; CHANNELS]);

    /// Brings the inputs into `channels`: once a millisecond, which filters count by. Must return
    /// within a few microseconds.
    ///
    /// # Errors
    ///
    /// [`ModuleError`] with the channels that could not be read. Every other channel has been read, and the
    /// failed ones are tried again the next time.
    fn read_inputs(&mut self, channels: &mut Channels) -> Result<(), ModuleError>;

    /// Drives the outputs as `channels` says: as often as [`read_inputs`](Self::read_inputs), and at
    /// once when one has been commanded. Must return within a few microseconds.
    ///
    /// # Errors
    ///
    /// [`ModuleError`] with the channels that could not be driven; otherwise as above.
    fn drive_outputs(&mut self, channels: &Channels) -> Result<(), ModuleError>;
}

/// An empty slot.
#[derive(Clone, Copy, Debug, Default)]
pub struct Absent;

impl IoModule for Absent {
    fn kinds(&self) -> [Kind; CHANNELS] {
        [Kind::None; CHANNELS]
    }

    fn configure(&mut self, _settings: &[ChannelSettings; CHANNELS]) {}

    fn read_inputs(&mut self, _channels: &mut Channels) -> Result<(), ModuleError> {
        Ok(())
    }

    fn drive_outputs(&mut self, _channels: &Channels) -> Result<(), ModuleError> {
        Ok(())
    }
}
