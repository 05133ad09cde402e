//! Tests of the driver with a link and a converter that answers immediately.

extern crate std;
use std::vec::Vec;

use super::*;
use crate::{ChannelStatus, Scale, Signal};

/// A converter with two lines. Any other line fails the test.
struct Lines([u16; 2], Vec<u8>);

impl AnalogSource for Lines {
    type Error = ();

    fn read(&mut self, line: u8) -> nb::Result<Code, ()> {
        self.1.push(line);
        match self.0.get(usize::from(line)) {
            Some(&u16::MAX) => Err(nb::Error::Other(())),
            Some(&code) => Ok(Code::new(code)),
            None => panic!("the module has no line {line}"),
        }
    }
}

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
    let mut module = Ai2Ao2::new(Lines([1000, 2000], Vec::new()));
    use Kind::{WordInput, WordOutput};
    assert_eq!(
        module.kinds(),
        [WordInput, WordInput, WordOutput, WordOutput]
    );
    let mut channels = commanded(7, 8);
    for _ in 0..3 {
        assert_eq!(module.read_inputs(&mut channels), Ok(()));
    }
    assert_eq!([0, 1, 2, 3].map(|c| channels.word(c)), [1000, 2000, 7, 8]);
    assert_eq!(module.inputs.source_mut().1, [0, 1, 0, 1, 0, 1]);
}

#[test]
fn outputs_are_the_channels_c_and_d_in_their_own_units() {
    let mut link = DacLink::default();
    let mut module = Ai2Ao2::new(Lines([0, 0], Vec::new()));
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
    module.read_inputs(&mut channels).unwrap();
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
    let mut module = Ai2Ao2::new(Lines([1, 2], Vec::new()));
    let mut channels = commanded(5, 4095);
    let failed = Err(ModuleError::chip(0b1100));
    assert_eq!(module.drive_outputs(&channels, &mut link), failed);
    assert_eq!(link.wanted, Some([0, 0, 5, 4095].map(Code::new)));
    assert_eq!(module.read_inputs(&mut channels), Ok(()));
    assert_eq!([0, 1].map(|c| channels.word(c)), [1, 2]);

    module.inputs.source_mut().0 = [u16::MAX, 3];
    assert_eq!(module.read_inputs(&mut channels), Err(ModuleError::line(0)));
}
