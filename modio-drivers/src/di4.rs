//! ModIO-DI: four isolated inputs for 5 to 24 V. An energised input pulls its line low.

use embedded_hal::digital::InputPin;
use register_map::limits::DEBOUNCE_DEFAULT_MS;

use crate::debounce::Debounce;
use crate::digital;
use crate::{CHANNELS, ChannelSettings, Channels, Codes, DacLink, IoModule, ModuleError};

/// Four debounced digital inputs.
///
/// An input counts as changed when its line has had the new level in as many scans in a row as its debounce has
/// milliseconds; with 0 it follows the line immediately. Shorter pulses are suppressed, and both edges are delayed
/// equally.
#[derive(Debug)]
pub struct Di4<P> {
    lines: [P; CHANNELS],
    filters: [Debounce; CHANNELS],
}

impl<P: InputPin> Di4<P> {
    /// Creates the driver with the four slot lines, which need pull-ups. The first scan takes the level of every
    /// input without a delay.
    pub const fn new(lines: [P; CHANNELS]) -> Self {
        Self {
            lines,
            filters: [Debounce::new(DEBOUNCE_DEFAULT_MS); CHANNELS],
        }
    }
}

impl<P: InputPin> IoModule for Di4<P> {
    /// Applies the debounce in [`ChannelSettings::filter`].
    fn configure(&mut self, settings: &[ChannelSettings; CHANNELS]) {
        for (filter, settings) in self.filters.iter_mut().zip(settings) {
            filter.set_needed(settings.filter);
        }
    }

    fn read_inputs(&mut self, channels: &mut Channels, _: &Codes) -> Result<(), ModuleError> {
        digital::read(&mut self.lines, &mut self.filters, channels)
    }

    fn drive_outputs(&mut self, _: &Channels, _: &mut DacLink) -> Result<(), ModuleError> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use super::*;
    use crate::Kind;
    use crate::digital::mock::{Mock, input};

    fn settings(debounce: u16) -> ChannelSettings {
        ChannelSettings {
            filter: debounce,
            ..ChannelSettings::default_for(Kind::BitInput)
        }
    }

    fn finish(mut module: Di4<Mock>) {
        module.lines.iter_mut().for_each(Mock::done);
    }

    #[test]
    fn the_first_scan_takes_the_inputs_without_delay() {
        let mut module = Di4::new([true, false, false, true].map(|on| input(&[on])));
        let mut channels = Channels::new();
        module.read_inputs(&mut channels, &[None; 4]).unwrap();
        assert_eq!(
            [0, 1, 2, 3].map(|c| channels.bit(c)),
            [true, false, false, true]
        );
        finish(module);
    }

    #[test]
    fn a_level_counts_after_as_many_scans_as_the_debounce_has_milliseconds() {
        for debounce in [0, 1, 2, 5, 1000] {
            let scans = usize::from(debounce).max(1) + 1;
            let mut levels = std::vec![false];
            levels.resize(scans, true);
            levels.resize(2 * scans - 1, false);
            let mut module = Di4::new([(); 4].map(|()| input(&levels)));
            module.configure(&[settings(debounce); CHANNELS]);
            let mut channels = Channels::new();
            let seen: Vec<bool> = levels
                .iter()
                .map(|_| {
                    module.read_inputs(&mut channels, &[None; 4]).unwrap();
                    channels.bit(2)
                })
                .collect();
            let (on, off) = (scans - 1, 2 * scans - 2);
            let expected: Vec<bool> = (0..levels.len()).map(|i| (on..off).contains(&i)).collect();
            assert_eq!(seen, expected, "debounce {debounce} ms");
            finish(module);
        }
    }

    #[test]
    fn a_pulse_shorter_than_the_debounce_is_suppressed_and_not_added_up() {
        let levels = [
            false, true, true, true, true, false, true, true, true, true, false,
        ];
        let mut module = Di4::new([(); 4].map(|()| input(&levels)));
        let mut channels = Channels::new();
        for _ in levels {
            module.read_inputs(&mut channels, &[None; 4]).unwrap();
            assert!(!channels.bit(0));
        }
        finish(module);
    }

    #[test]
    fn each_channel_has_its_own_debounce_and_equal_settings_do_not_disturb() {
        let levels = [false, true, true, true, true, true];
        let mut module = Di4::new([(); 4].map(|()| input(&levels)));
        let mut channels = Channels::new();
        let seen = levels.map(|_| {
            module.configure(&[0, 2, 4, 5].map(settings));
            module.read_inputs(&mut channels, &[None; 4]).unwrap();
            [0, 1, 2, 3].map(|c| u8::from(channels.bit(c)))
        });
        assert_eq!(
            seen,
            [
                [0, 0, 0, 0],
                [1, 0, 0, 0],
                [1, 1, 0, 0],
                [1, 1, 0, 0],
                [1, 1, 1, 0],
                [1, 1, 1, 1],
            ]
        );
        finish(module);
    }
}
