//! ModIO-Relay: two relays for 2 A. Lines 1 and 2 read the mode jumper of each relay, low for manual. Lines 3 and 4
//! drive the coils, high for energised.

use embedded_hal::digital::{InputPin, OutputPin};

use crate::debounce::Debounce;
use crate::digital;
use crate::{CHANNELS, ChannelSettings, Channels, Codes, DacLink, IoModule, ModuleError};

/// Debounce of the mode jumpers, in milliseconds. A jumper is moved by hand, and its contacts bounce for longer
/// than a switch.
pub const JUMPER_DEBOUNCE_MS: u16 = 20;

/// Channel of the first coil.
const FIRST_COIL: usize = 2;

/// Two relays: channels 1 and 2 are the jumpers, 1 for manual; channels 3 and 4 are the coils.
///
/// A relay in manual mode is controlled by its jumper. The coil's line still follows its channel, so the relay
/// takes its commanded position when the jumper is moved back.
#[derive(Debug)]
pub struct Relay2<I, O> {
    jumpers: [I; 2],
    filters: [Debounce; 2],
    coils: [O; 2],
}

impl<I: InputPin, O: OutputPin> Relay2<I, O> {
    /// Creates the driver with the slot lines. The first two need pull-ups. The others must already be outputs that
    /// drive low, so that no relay is energised before the first scan. The first scan takes the level of the
    /// jumpers without a delay.
    pub const fn new(jumpers: [I; 2], coils: [O; 2]) -> Self {
        Self {
            jumpers,
            filters: [Debounce::new(JUMPER_DEBOUNCE_MS); 2],
            coils,
        }
    }
}

impl<I: InputPin, O: OutputPin> IoModule for Relay2<I, O> {
    /// There are no settings: the jumpers' debounce is [`JUMPER_DEBOUNCE_MS`].
    fn configure(&mut self, _settings: &[ChannelSettings; CHANNELS]) {}

    fn read_inputs(&mut self, channels: &mut Channels, _: &Codes) -> Result<(), ModuleError> {
        digital::read(&mut self.jumpers, &mut self.filters, channels)
    }

    fn drive_outputs(&mut self, channels: &Channels, _: &mut DacLink) -> Result<(), ModuleError> {
        digital::drive(&mut self.coils, FIRST_COIL, channels)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::Kind;
    use crate::digital::mock::{Mock, State, Transaction, failing, input, output};

    fn finish(mut module: Relay2<Mock, Mock>) {
        module.jumpers.iter_mut().for_each(Mock::done);
        module.coils.iter_mut().for_each(Mock::done);
    }

    #[test]
    fn jumpers_are_read_without_delay_at_the_first_scan_and_do_not_change_coils() {
        let mut module = Relay2::new(
            [input(&[true]), input(&[false])],
            [output(&[]), output(&[])],
        );
        let mut channels = Channels::new();
        channels.set_bit(3, true);
        module.read_inputs(&mut channels, &[None; 4]).unwrap();
        assert_eq!(
            [0, 1, 2, 3].map(|c| channels.bit(c)),
            [true, false, false, true]
        );
        finish(module);
    }

    #[test]
    fn a_jumper_is_debounced_for_a_fixed_time_independent_of_the_settings() {
        let wait = usize::from(JUMPER_DEBOUNCE_MS);
        let mut levels = std::vec![false; 1];
        levels.resize(wait, true);
        levels.push(false);
        levels.resize(2 * wait + 1, true);
        let mut module = Relay2::new([input(&levels), input(&levels)], [output(&[]), output(&[])]);
        let settings = ChannelSettings {
            filter: 0,
            ..ChannelSettings::default_for(Kind::BitInput)
        };
        let mut channels = Channels::new();
        for scan in 0..levels.len() {
            module.configure(&[settings; 4]);
            module.read_inputs(&mut channels, &[None; 4]).unwrap();
            assert_eq!(channels.bit(0), scan == 2 * wait, "scan {scan}");
            assert_eq!(channels.bit(1), channels.bit(0));
        }
        finish(module);
    }

    #[test]
    fn coils_follow_channels_3_and_4_at_every_scan() {
        let mut module = Relay2::new(
            [input(&[]), input(&[])],
            [output(&[false, true, true]), output(&[false, false, true])],
        );
        let mut channels = Channels::new();
        channels.set_bit(0, true);
        // The jumper of relay 2, and then the coils.
        for channel in 1..=3 {
            channels.set_bit(channel, true);
            module
                .drive_outputs(&channels, &mut DacLink::default())
                .unwrap();
        }
        finish(module);
    }

    #[test]
    fn a_line_that_fails_is_reported_and_the_others_still_work() {
        let mut module = Relay2::new(
            [failing(Transaction::get(State::High)), input(&[true])],
            [failing(Transaction::set(State::Low)), output(&[true])],
        );
        let mut channels = Channels::new();
        channels.set_bit(3, true);
        assert_eq!(
            module.read_inputs(&mut channels, &[None; 4]),
            Err(ModuleError::line(0))
        );
        assert!(channels.bit(1));
        assert_eq!(
            module.drive_outputs(&channels, &mut DacLink::default()),
            Err(ModuleError::line(2))
        );
        finish(module);
    }
}
