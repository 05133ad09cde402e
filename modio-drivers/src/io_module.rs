//! What every module's driver can do.

use crate::{CHANNELS, Channels, Kind};

/// A module could not be read or driven; its channels keep what they had.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ModuleError {
    /// A line of the slot could not be read or driven: the channel it belongs to, 0 to 3.
    Line {
        /// The channel.
        channel: usize,
    },
}

/// A plug-in module in its slot.
pub trait IoModule {
    /// What each of the four channels is. Never changes while the module is in use.
    fn kinds(&self) -> [Kind; CHANNELS];

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

    fn read_inputs(&mut self, _channels: &mut Channels) -> Result<(), ModuleError> {
        Ok(())
    }

    fn drive_outputs(&mut self, _channels: &Channels) -> Result<(), ModuleError> {
        Ok(())
    }
}
