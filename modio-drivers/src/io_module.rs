//! What every module's driver can do.

use crate::{CHANNELS, ChannelSettings, Channels, Kind};

/// A module could not be read or driven; its channels keep what they had.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ModuleError {
    /// A line of the slot could not be read or driven: the channel it belongs to, 0 to 3.
    Line {
        /// The channel.
        channel: usize,
    },
    /// The module's own chip does not answer. It is tried again all the time.
    NotAnswering,
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
    /// [`ModuleError`] when a channel could not be read. Every other channel has been read all the
    /// same, and the failed one is tried again the next time.
    fn read_inputs(&mut self, channels: &mut Channels) -> Result<(), ModuleError>;

    /// Drives the outputs as `channels` says: as often as [`read_inputs`](Self::read_inputs), and at
    /// once when one has been commanded. Must return within a few microseconds.
    ///
    /// # Errors
    ///
    /// [`ModuleError`] when a channel could not be driven; otherwise as above.
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
