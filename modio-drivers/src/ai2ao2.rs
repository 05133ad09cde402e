//! ModIO-AIAO: two analog inputs on lines 1 and 2, like those of ModIO-AI, and two analog outputs, 3 and 4, like
//! those of ModIO-AO, on the channels C and D of an MCP4728.

use crate::analog_inputs::AnalogInputs;
use crate::ao4::output_code;
use crate::{
    CHANNELS, ChannelSettings, Channels, Code, Codes, DacLink, IoModule, Kind, ModuleError,
};

/// Two filtered analog inputs and two analog outputs.
#[derive(Debug)]
pub struct Ai2Ao2 {
    inputs: AnalogInputs,
    /// Settings of channels 3 and 4.
    outputs: [ChannelSettings; 2],
}

impl Default for Ai2Ao2 {
    fn default() -> Self {
        Self {
            inputs: AnalogInputs::new(2),
            outputs: [ChannelSettings::default_for(Kind::WordOutput); 2],
        }
    }
}

/// Channels 3 and 4, which the DAC drives; channel 1 is bit 0.
const OUTPUTS: u8 = 0b1100;

impl IoModule for Ai2Ao2 {
    /// The settings have the same meaning as for [`Ai4`](crate::Ai4) and [`Ao4`](crate::Ao4).
    fn configure(&mut self, settings: &[ChannelSettings; CHANNELS]) {
        self.inputs.configure(settings);
        let [_, _, third, fourth] = *settings;
        self.outputs = [third, fourth];
    }

    fn read_inputs(&mut self, channels: &mut Channels, codes: &Codes) -> Result<(), ModuleError> {
        self.inputs.scan(codes, channels)
    }

    /// Leaves the codes in the link. The DAC channels A and B, which are not connected, stay at 0. Returns an error for
    /// both outputs while the codes do not reach the DAC.
    fn drive_outputs(&mut self, channels: &Channels, dac: &mut DacLink) -> Result<(), ModuleError> {
        let [third, fourth] = &self.outputs;
        let codes = [
            Code::default(),
            Code::default(),
            output_code(channels, 2, third),
            output_code(channels, 3, fourth),
        ];
        dac.drive(codes, OUTPUTS)
    }
}

#[cfg(test)]
mod tests;
