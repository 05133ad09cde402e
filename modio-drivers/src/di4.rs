//! ModIO-DI: four isolated inputs for 5 to 24 V. An energised input pulls its line low.

use embedded_hal::digital::InputPin;

use crate::{CHANNELS, Channels, IoModule, Kind, ModuleError};

/// Debounce of every input until told otherwise, in milliseconds.
pub const DEBOUNCE_DEFAULT_MS: u16 = 5;

/// The longest debounce, in milliseconds.
pub const DEBOUNCE_MAX_MS: u16 = 1000;

/// Four debounced digital inputs.
///
/// An input counts as changed when its line has stood at the new level in every one of as many
/// scans as its debounce has milliseconds; with 0 it follows the line at once. A pulse shorter than
/// the debounce is not seen, and both edges are delayed alike.
#[derive(Debug)]
pub struct Di4<P> {
    lines: [P; CHANNELS],
    filters: [Debounce; CHANNELS],
}

impl<P: InputPin> Di4<P> {
    /// Takes over the four slot lines, which need pull-ups. The first scan takes every input as it
    /// stands, without waiting.
    pub const fn new(lines: [P; CHANNELS]) -> Self {
        Self {
            lines,
            filters: [Debounce::new(DEBOUNCE_DEFAULT_MS); CHANNELS],
        }
    }

    /// Sets the debounce of a channel, 0 to 3, in milliseconds, and returns what it is now: at most
    /// [`DEBOUNCE_MAX_MS`], and 0 for a channel that does not exist.
    pub fn set_debounce(&mut self, channel: usize, milliseconds: u16) -> u16 {
        match self.filters.get_mut(channel) {
            Some(filter) => {
                filter.needed = milliseconds.min(DEBOUNCE_MAX_MS);
                filter.needed
            }
            None => 0,
        }
    }
}

impl<P: InputPin> IoModule for Di4<P> {
    fn kinds(&self) -> [Kind; CHANNELS] {
        [Kind::BitInput; CHANNELS]
    }

    fn read_inputs(&mut self, channels: &mut Channels) -> Result<(), ModuleError> {
        let mut result = Ok(());
        let lines = self.lines.iter_mut().zip(&mut self.filters);
        for (channel, (line, filter)) in lines.enumerate() {
            match line.is_low() {
                Ok(energised) => channels.set_bit(channel, filter.sample(energised)),
                Err(_) => result = Err(ModuleError::Line { channel }),
            }
        }
        result
    }

    fn drive_outputs(&mut self, _channels: &Channels) -> Result<(), ModuleError> {
        Ok(())
    }
}

/// The filter of one input.
#[derive(Clone, Copy, Debug)]
struct Debounce {
    /// Scans a new level must stand before it counts.
    needed: u16,
    /// Scans the new level has stood so far.
    seen: u16,
    /// The level that counts, none before the first sample.
    level: Option<bool>,
}

impl Debounce {
    const fn new(needed: u16) -> Self {
        Self {
            needed,
            seen: 0,
            level: None,
        }
    }

    fn sample(&mut self, now: bool) -> bool {
        let level = self.level.unwrap_or(now);
        self.seen = if now == level { 0 } else { self.seen + 1 };
        let changed = self.seen > 0 && self.seen >= self.needed;
        if changed {
            self.seen = 0;
        }
        let level = level != changed;
        self.level = Some(level);
        level
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::vec::Vec;

    use embedded_hal_mock::eh1::MockError;
    use embedded_hal_mock::eh1::digital::{Mock, State, Transaction};

    use super::*;

    /// A line that shows these levels, one a scan: `true` is energised, so low.
    fn line(energised: &[bool]) -> Mock {
        let states = energised
            .iter()
            .map(|&on| Transaction::get(if on { State::Low } else { State::High }));
        Mock::new(&states.collect::<Vec<_>>())
    }

    fn finish(mut module: Di4<Mock>) {
        module.lines.iter_mut().for_each(Mock::done);
    }

    #[test]
    fn the_first_scan_takes_the_inputs_as_they_stand() {
        let mut module = Di4::new([true, false, false, true].map(|on| line(&[on])));
        let mut channels = Channels::new();
        module.read_inputs(&mut channels).unwrap();
        assert_eq!(
            [0, 1, 2, 3].map(|c| channels.bit(c)),
            [true, false, false, true]
        );
        assert_eq!(module.kinds(), [Kind::BitInput; 4]);
        finish(module);
    }

    #[test]
    fn a_level_counts_after_as_many_scans_as_the_debounce_has_milliseconds() {
        for debounce in [0, 1, 2, 5, 1000] {
            let scans = usize::from(debounce).max(1) + 1;
            let mut levels = std::vec![false];
            levels.resize(scans, true);
            levels.resize(2 * scans - 1, false);
            let mut module = Di4::new([(); 4].map(|()| line(&levels)));
            for channel in 0..CHANNELS {
                assert_eq!(module.set_debounce(channel, debounce), debounce);
            }
            let mut channels = Channels::new();
            let seen: Vec<bool> = levels
                .iter()
                .map(|_| {
                    module.read_inputs(&mut channels).unwrap();
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
    fn a_pulse_shorter_than_the_debounce_is_not_seen_and_does_not_add_up() {
        let levels = [
            false, true, true, true, true, false, true, true, true, true, false,
        ];
        let mut module = Di4::new([(); 4].map(|()| line(&levels)));
        let mut channels = Channels::new();
        for _ in levels {
            module.read_inputs(&mut channels).unwrap();
            assert!(!channels.bit(0));
        }
        finish(module);
    }

    #[test]
    fn a_line_that_cannot_be_read_keeps_its_bit_and_leaves_the_others_alone() {
        let failing = Mock::new(&[
            Transaction::get(State::Low),
            Transaction::get(State::High)
                .with_error(MockError::Io(std::io::ErrorKind::NotConnected)),
        ]);
        let good = || line(&[true, true]);
        let mut module = Di4::new([good(), failing, good(), good()]);
        let mut channels = Channels::new();
        module.read_inputs(&mut channels).unwrap();
        assert_eq!(
            module.read_inputs(&mut channels),
            Err(ModuleError::Line { channel: 1 })
        );
        assert_eq!([0, 1, 2, 3].map(|c| channels.bit(c)), [true; 4]);
        finish(module);
    }

    #[test]
    fn a_debounce_too_long_or_of_no_channel_is_not_taken() {
        let mut module = Di4::new([(); 4].map(|()| line(&[])));
        assert_eq!(module.set_debounce(0, 5000), DEBOUNCE_MAX_MS);
        assert_eq!(module.set_debounce(4, 10), 0);
        finish(module);
    }
}
