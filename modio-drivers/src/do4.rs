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
    extern crate std;
    use std::vec::Vec;

    use embedded_hal_mock::eh1::digital::{Mock, State, Transaction};

    use super::*;

    fn line(levels: &[State]) -> Mock {
        Mock::new(
            &levels
                .iter()
                .map(|&l| Transaction::set(l))
                .collect::<Vec<_>>(),
        )
    }

    #[test]
    fn every_line_follows_its_bit_at_every_scan() {
        use State::{High, Low};
        let mut module = Do4::new([
            line(&[High, High, Low]),
            line(&[Low, Low, High]),
            line(&[Low, Low, Low]),
            line(&[High, High, High]),
        ]);
        let mut channels = Channels::new();
        channels.set_bit(0, true);
        channels.set_bit(3, true);
        module
            .drive_outputs(&channels, &mut DacLink::default())
            .unwrap();
        module
            .drive_outputs(&channels, &mut DacLink::default())
            .unwrap();
        channels.set_bit(0, false);
        channels.set_bit(1, true);
        module
            .drive_outputs(&channels, &mut DacLink::default())
            .unwrap();
        assert!(
            channels.bit(1) && channels.bit(3),
            "reading does not change outputs"
        );
        module.lines.iter_mut().for_each(Mock::done);
    }
}
