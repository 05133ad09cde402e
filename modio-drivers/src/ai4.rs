//! ModIO-AI: four analog inputs, each set by its jumper to 0-10 V, 4-20 mA or a 10 k thermistor. The module
//! converts each signal to 0-3.3 V on its line. 10 V and 20 mA (through 165 ohm) give 3.3 V. A thermistor to ground
//! has a pull-up of 10 k to 3.3 V.

use crate::analog_inputs::AnalogInputs;
use crate::{
    AnalogSource, CHANNELS, ChannelSettings, Channels, DacLink, IoModule, Kind, ModuleError,
};

/// Four filtered analog inputs.
///
/// A channel's word and status are computed from its filtered code. [`scale`](crate::scale) describes the units,
/// [`input_status`](crate::input_status) the status.
#[derive(Debug)]
pub struct Ai4<S> {
    inputs: AnalogInputs<S>,
}

impl<S: AnalogSource> Ai4<S> {
    /// Creates the driver. The converter's lines must already be analog inputs. The first sample of each line is
    /// shown without filtering.
    pub const fn new(source: S) -> Self {
        Self {
            inputs: AnalogInputs::new(source, CHANNELS),
        }
    }
}

impl<S: AnalogSource> IoModule for Ai4<S> {
    fn kinds(&self) -> [Kind; CHANNELS] {
        [Kind::WordInput; CHANNELS]
    }

    fn configure(&mut self, settings: &[ChannelSettings; CHANNELS]) {
        self.inputs.configure(settings);
    }

    /// A channel fails when its conversion failed. All channels fail when the converter has not answered for
    /// [`STALLED_SCANS`](crate::STALLED_SCANS) scans.
    fn read_inputs(&mut self, channels: &mut Channels) -> Result<(), ModuleError> {
        self.inputs.scan(channels)
    }

    fn drive_outputs(&mut self, _: &Channels, _: &mut DacLink) -> Result<(), ModuleError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests;
