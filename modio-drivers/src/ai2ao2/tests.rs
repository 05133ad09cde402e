//! Tests of the driver with a link and the codes of its lines.

use super::*;
use crate::{ChannelStatus, STALLED_SCANS, Scale, Signal};

fn with(signal: Signal, scale: Scale) -> ChannelSettings {
    ChannelSettings {
        signal,
        scale,
        ..ChannelSettings::default_for(Kind::WordInput)
    }
}

fn commanded(third: u16, fourth: u16) -> Channels {
    let mut channels = Channels::new();
    channels.set_word(2, third);
    channels.set_word(3, fourth);
    channels
}

#[test]
fn inputs_are_lines_1_and_2_and_reading_does_not_change_outputs() {
    let mut module = Ai2Ao2::default();
    let mut channels = commanded(7, 8);
    let codes = [Some(1000), Some(2000), None, None];
    for _ in 0..2 * STALLED_SCANS {
        assert_eq!(module.read_inputs(&mut channels, &codes), Ok(()));
    }
    assert_eq!([0, 1, 2, 3].map(|c| channels.word(c)), [1000, 2000, 7, 8]);
}

#[test]
fn outputs_are_the_channels_c_and_d_in_their_own_units() {
    let mut link = DacLink::default();
    let mut module = Ai2Ao2::default();
    let channels = commanded(4000, 4095);
    module.drive_outputs(&channels, &mut link).unwrap();
    assert_eq!(link.wanted, Some([0, 0, 4000, 4095].map(Code::new)));
    module.configure(&[
        with(Signal::Ntc, Scale::Engineering),
        with(Signal::Current, Scale::Engineering),
        with(Signal::Current, Scale::Engineering),
        with(Signal::Voltage, Scale::Engineering),
    ]);
    module.drive_outputs(&channels, &mut link).unwrap();
    assert_eq!(link.wanted, Some([0, 0, 819, 1677].map(Code::new)));

    let mut channels = channels;
    module.read_inputs(&mut channels, &[Some(0); 4]).unwrap();
    use ChannelStatus::{Good, OpenCircuit, ShortCircuit};
    let status = [0, 1, 2, 3].map(|c| channels.status(c));
    assert_eq!(status, [ShortCircuit, OpenCircuit, Good, Good]);
}

#[test]
fn a_dac_that_does_not_answer_is_an_error_of_its_channels_while_inputs_are_still_read() {
    let mut link = DacLink {
        failed: true,
        ..DacLink::default()
    };
    let mut module = Ai2Ao2::default();
    let mut channels = commanded(5, 4095);
    let failed = Err(ModuleError::chip(0b1100));
    assert_eq!(module.drive_outputs(&channels, &mut link), failed);
    assert_eq!(link.wanted, Some([0, 0, 5, 4095].map(Code::new)));
    let codes = [1, 2, 3, 4].map(Some);
    assert_eq!(module.read_inputs(&mut channels, &codes), Ok(()));
    assert_eq!([0, 1].map(|c| channels.word(c)), [1, 2]);
}
