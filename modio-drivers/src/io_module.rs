//! The interface of every module's driver.

use crate::{CHANNELS, ChannelSettings, Channels, Codes, DacLink};

/// Channels of a module that could not be read or driven. They keep their values and are tried again at every scan.
/// All other channels have been served.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModuleError {
    /// Channels whose own slot line failed, channel 1 in bit 0.
    lines: u8,
    /// Channels whose chip on the module does not answer, channel 1 in bit 0.
    chip: u8,
}

impl ModuleError {
    /// Returns the error that the slot line of this channel, 0 to 3, could not be read or driven.
    #[must_use]
    pub const fn line(channel: usize) -> Self {
        Self {
            lines: 1 << (channel % CHANNELS),
            chip: 0,
        }
    }

    /// Returns the error that the module's chip does not answer, which serves these channels, channel 1 in bit 0.
    #[must_use]
    pub const fn chip(channels: u8) -> Self {
        Self {
            lines: 0,
            chip: channels,
        }
    }

    /// Returns every channel that failed, channel 1 in bit 0.
    #[must_use]
    pub const fn channels(self) -> u8 {
        self.lines | self.chip
    }

    /// Returns the first channel, 0 to 3, whose own line failed; `None` when the module's chip does not answer.
    #[must_use]
    pub const fn first_line(self) -> Option<usize> {
        if self.chip == 0 && self.lines != 0 {
            Some(self.lines.trailing_zeros() as usize)
        } else {
            None
        }
    }

    /// Combines two results.
    ///
    /// # Errors
    ///
    /// The channels that failed in either result.
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
    /// Sets how each channel is read or driven, in force from the next scan on. May be called at any time between
    /// two scans. A channel whose settings have not changed is not disturbed: a debounce continues and a filter
    /// keeps its state.
    ///
    /// Settings that do not apply to a channel are ignored, and a setting out of range becomes the nearest value in
    /// range. Until the first call, [`ChannelSettings::default_for`] is in force.
    fn configure(&mut self, settings: &[ChannelSettings; CHANNELS]);

    /// Reads the inputs into `channels`. `codes` are the codes of the slot's lines. Must be called once per millisecond, which is the unit of the filters.
    /// Returns within a few microseconds.
    ///
    /// # Errors
    ///
    /// [`ModuleError`] with the channels that could not be read. Every other channel has been read, and the failed
    /// ones are tried again at the next call.
    fn read_inputs(&mut self, channels: &mut Channels, codes: &Codes) -> Result<(), ModuleError>;

    /// Drives the outputs from `channels`. `dac` is the link to the DAC of the module's slot. Must be called as often as [`read_inputs`](Self::read_inputs), and also
    /// immediately after an output was commanded. Returns within a few microseconds.
    ///
    /// # Errors
    ///
    /// [`ModuleError`] with the channels that could not be driven. Every other channel has been driven.
    fn drive_outputs(&mut self, channels: &Channels, dac: &mut DacLink) -> Result<(), ModuleError>;
}

/// An empty slot.
#[derive(Clone, Copy, Debug, Default)]
pub struct Absent;

impl IoModule for Absent {
    fn configure(&mut self, _settings: &[ChannelSettings; CHANNELS]) {}

    fn read_inputs(&mut self, _: &mut Channels, _: &Codes) -> Result<(), ModuleError> {
        Ok(())
    }

    fn drive_outputs(&mut self, _: &Channels, _: &mut DacLink) -> Result<(), ModuleError> {
        Ok(())
    }
}
