//! ModIO-AI: four analog inputs, 0-10 V, 4-20 mA or a 10 k thermistor, each by its jumper. The module
//! brings each signal to 0-3.3 V on its line: 10 V and 20 mA (over 165 ohm) are 3.3 V, a thermistor
//! to ground stands under a pull-up of 10 k to 3.3 V.

use crate::analog_inputs::AnalogInputs;
use crate::{AnalogSource, CHANNELS, ChannelSettings, Channels, IoModule, Kind, ModuleError};

/// Four filtered analog inputs.
///
/// A channel's word and status follow its low-pass filter; see [`scale`](crate::scale) for the units
/// and [`input_status`](crate::input_status) for the status.
#[derive(Debug)]
pub struct Ai4<S> {
    inputs: AnalogInputs<S>,
}

impl<S: AnalogSource> Ai4<S> {
    /// Takes over the converter, whose lines are analog inputs by now. The first sample of each line
    /// shows at once.
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

    /// As the trait says. A channel fails when its conversion failed; all of them fail when the converter has not
    /// answered in [`STALLED_SCANS`](crate::STALLED_SCANS) scans.
    fn read_inputs(&mut self, channels: &mut Channels) -> Result<(), ModuleError> {
        self.inputs.scan(channels)
    }

    fn drive_outputs(&mut self, _channels: &Channels) -> Result<(), ModuleError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests;
