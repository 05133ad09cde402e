//! ModIO-AI: four analog inputs, each set by its jumper to 0-10 V, 4-20 mA or a 10 k thermistor. The module
//! converts each signal to 0-3.3 V on its line. 10 V and 20 mA (through 165 ohm) give 3.3 V. A thermistor to ground
//! has a pull-up of 10 k to 3.3 V.

use crate::analog_inputs::AnalogInputs;
use crate::{CHANNELS, ChannelSettings, Channels, Codes, DacLink, IoModule, ModuleError};

/// Four filtered analog inputs.
///
/// A channel's word and status are computed from its filtered code. [`scale`](crate::scale) describes the units,
/// [`input_status`](crate::input_status) the status.
#[derive(Debug)]
pub struct Ai4(AnalogInputs);

impl Default for Ai4 {
    fn default() -> Self {
        Self(AnalogInputs::new(CHANNELS))
    }
}

impl IoModule for Ai4 {
    fn configure(&mut self, settings: &[ChannelSettings; CHANNELS]) {
        self.0.configure(settings);
    }

    /// A channel fails when its line has had no code for [`STALLED_SCANS`](crate::STALLED_SCANS) scans.
    fn read_inputs(&mut self, channels: &mut Channels, codes: &Codes) -> Result<(), ModuleError> {
        self.0.scan(codes, channels)
    }

    fn drive_outputs(&mut self, _: &Channels, _: &mut DacLink) -> Result<(), ModuleError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests;
