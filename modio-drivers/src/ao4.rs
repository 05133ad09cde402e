//! ModIO-AO: four analog outputs, each set by its jumper to 0-10 V or 4-20 mA. They are the channels A to D of an
//! MCP4728 whose full scale is 10 V or 20 mA.

use crate::{
    CHANNELS, ChannelSettings, Channels, Code, Codes, DacLink, IoModule, Kind, ModuleError,
    scale::output_to_raw,
};

/// Four analog outputs.
///
/// The driver only leaves codes in a [`DacLink`]; a [`DacWorker`](crate::DacWorker) transfers them.
#[derive(Debug)]
pub struct Ao4 {
    settings: [ChannelSettings; CHANNELS],
}

impl Default for Ao4 {
    fn default() -> Self {
        Self {
            settings: [ChannelSettings::default_for(Kind::WordOutput); CHANNELS],
        }
    }
}

/// Channels that the DAC drives: all of the module.
const ALL: u8 = 0b1111;

impl IoModule for Ao4 {
    /// Applies range and scale. They also define the meaning of a word that is already in [`Channels`], so the
    /// caller must convert it; see [`output_rescaled`](crate::scale::output_rescaled).
    fn configure(&mut self, settings: &[ChannelSettings; CHANNELS]) {
        self.settings = *settings;
    }

    fn read_inputs(&mut self, _: &mut Channels, _: &Codes) -> Result<(), ModuleError> {
        Ok(())
    }

    /// Leaves the codes in the link. Returns an error for all channels while the codes do not reach the DAC.
    fn drive_outputs(&mut self, channels: &Channels, dac: &mut DacLink) -> Result<(), ModuleError> {
        let mut codes = [Code::default(); CHANNELS];
        for (channel, (code, settings)) in codes.iter_mut().zip(&self.settings).enumerate() {
            *code = output_code(channels, channel, settings);
        }
        dac.drive(codes, ALL)
    }
}

/// Returns the DAC's code for a channel's word.
pub(crate) fn output_code(channels: &Channels, channel: usize, settings: &ChannelSettings) -> Code {
    output_to_raw(channels.word(channel), settings.signal, settings.scale)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::{Scale, Signal};

    fn words(words: [u16; 4]) -> Channels {
        let mut channels = Channels::new();
        for (channel, word) in words.into_iter().enumerate() {
            channels.set_word(channel, word);
        }
        channels
    }

    fn settings(signal: Signal, scale: Scale) -> ChannelSettings {
        ChannelSettings {
            signal,
            scale,
            ..ChannelSettings::default_for(Kind::WordOutput)
        }
    }

    #[test]
    fn raw_words_are_driven_unchanged_up_to_the_largest_code() {
        let mut link = DacLink::default();
        let mut module = Ao4::default();
        module
            .drive_outputs(&words([0, 1, 4095, 4096]), &mut link)
            .unwrap();
        assert_eq!(link.wanted, Some([0, 1, 4095, 4095].map(Code::new)));
    }

    #[test]
    fn each_channel_has_its_own_units() {
        let mut link = DacLink::default();
        let mut module = Ao4::default();
        module.configure(&[
            settings(Signal::Voltage, Scale::Engineering),
            settings(Signal::Current, Scale::Engineering),
            settings(Signal::Voltage, Scale::Raw),
            settings(Signal::Current, Scale::Raw),
        ]);
        let channels = words([5_000, 12_000, 2_000, 819]);
        module.drive_outputs(&channels, &mut link).unwrap();
        assert_eq!(link.wanted, Some([2_048, 2_457, 2_000, 819].map(Code::new)));

        module.configure(&[settings(Signal::Voltage, Scale::Raw); 4]);
        module.drive_outputs(&channels, &mut link).unwrap();
        assert_eq!(link.wanted, Some([4_095, 4_095, 2_000, 819].map(Code::new)));
    }

    #[test]
    fn a_failed_link_is_reported_and_still_receives_codes() {
        let mut link = DacLink::default();
        let mut module = Ao4::default();
        let channels = words([1, 2, 3, 4]);
        link.failed = true;
        let failed = Err(ModuleError::chip(ALL));
        assert_eq!(module.drive_outputs(&channels, &mut link), failed);
        assert_eq!(link.wanted, Some([1, 2, 3, 4].map(Code::new)));
        link.failed = false;
        assert_eq!(module.drive_outputs(&channels, &mut link), Ok(()));
    }
}
