//! ModIO-DO: four open-collector outputs for 5 to 30 V, 200 mA. A high line makes its transistor conduct.

use embedded_hal::digital::OutputPin;

use crate::digital;
use crate::{CHANNELS, ChannelSettings, Channels, Codes, DacLink, IoModule, ModuleError};

/// Four digital outputs.
#[derive(Debug)]
pub struct Do4<P> {
    lines: [P; CHANNELS],
}

impl<P: OutputPin> Do4<P> {
    /// Creates the driver with the four slot lines. They must already be outputs that drive low, so that no output
    /// conducts before the first scan.
    pub const fn new(lines: [P; CHANNELS]) -> Self {
        Self { lines }
    }
}

impl<P: OutputPin> IoModule for Do4<P> {
    fn configure(&mut self, _settings: &[ChannelSettings; CHANNELS]) {}

    fn read_inputs(&mut self, _: &mut Channels, _: &Codes) -> Result<(), ModuleError> {
        Ok(())
    }

    fn drive_outputs(&mut self, channels: &Channels, _: &mut DacLink) -> Result<(), ModuleError> {
        digital::drive(&mut self.lines, 0, channels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::digital::mock::{Mock, output};

    #[test]
    fn every_line_follows_its_bit_at_every_scan() {
        let mut module = Do4::new([
            output(&[true, true, false]),
            output(&[false, false, true]),
            output(&[false, false, false]),
            output(&[true, true, true]),
        ]);
        let mut channels = Channels::new();
        for bits in [
            [true, false, false, true],
            [true, false, false, true],
            [false, true, false, true],
        ] {
            for (channel, bit) in bits.into_iter().enumerate() {
                channels.set_bit(channel, bit);
            }
            module
                .drive_outputs(&channels, &mut DacLink::default())
                .unwrap();
        }
        assert!(
            channels.bit(1) && channels.bit(3),
            "driving does not change the channels"
        );
        module.lines.iter_mut().for_each(Mock::done);
    }
}
