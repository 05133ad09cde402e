//! Tests of the driver with a mock converter; embedded-hal-mock has none for embedded-hal 1.

extern crate std;
use std::vec::Vec;

use super::*;
use crate::{ChannelStatus, Code, POLLS_PER_SCAN, STALLED_SCANS, Scale, Signal};

/// A mock converter: the code of each line and the number of calls that a conversion takes.
#[derive(Default)]
struct Converter {
    codes: [u16; 4],
    broken: [bool; 4],
    /// Number of calls during which a conversion blocks.
    delay: u32,
    asked: u32,
    converting: Option<u8>,
    calls: u32,
    /// Lines whose conversions have ended, in order.
    answered: Vec<u8>,
}

impl AnalogSource for Converter {
    type Error = &'static str;

    fn read(&mut self, line: u8) -> nb::Result<Code, Self::Error> {
        self.calls += 1;
        let under_way = *self.converting.get_or_insert(line);
        assert_eq!(
            under_way, line,
            "another line was asked for during a conversion"
        );
        self.asked += 1;
        if self.asked <= self.delay {
            return Err(nb::Error::WouldBlock);
        }
        (self.asked, self.converting) = (0, None);
        self.answered.push(line);
        if self.broken[usize::from(line)] {
            return Err(nb::Error::Other("broken"));
        }
        Ok(Code::new(self.codes[usize::from(line)]))
    }
}

fn with(filter: u16, signal: Signal, scale: Scale) -> ChannelSettings {
    ChannelSettings {
        filter,
        signal,
        scale,
        ..ChannelSettings::default_for(Kind::WordInput)
    }
}

fn raw(filter: u16) -> [ChannelSettings; 4] {
    [with(filter, Signal::Voltage, Scale::Raw); 4]
}

fn words(channels: &Channels) -> [u16; 4] {
    [0, 1, 2, 3].map(|channel| channels.word(channel))
}

fn statuses(channels: &Channels) -> [ChannelStatus; 4] {
    [0, 1, 2, 3].map(|channel| channels.status(channel))
}

/// Scans with these codes on the lines, expects no error, and returns the words.
fn scan(module: &mut Ai4<&mut Converter>, channels: &mut Channels) -> [u16; 4] {
    module.read_inputs(channels).unwrap();
    words(channels)
}

#[test]
fn every_line_is_sampled_once_per_scan_and_shown_immediately() {
    let mut converter = Converter {
        codes: [0, 1, 2048, 4095],
        ..Converter::default()
    };
    let mut module = Ai4::new(&mut converter);
    let mut channels = Channels::new();
    assert_eq!(module.kinds(), [Kind::WordInput; 4]);
    assert_eq!(scan(&mut module, &mut channels), [0, 1, 2048, 4095]);
    assert_eq!(scan(&mut module, &mut channels), [0, 1, 2048, 4095]);
    assert_eq!(
        module.drive_outputs(&channels, &mut DacLink::default()),
        Ok(())
    );
    assert_eq!(converter.answered, [0, 1, 2, 3, 0, 1, 2, 3]);
    assert_eq!(converter.calls, 8);
}

#[test]
fn each_channel_has_its_own_range_and_scale() {
    let mut converter = Converter {
        codes: [2048, 2457, 3160, 5000],
        ..Converter::default()
    };
    let mut module = Ai4::new(&mut converter);
    module.configure(&[
        with(0, Signal::Voltage, Scale::Engineering),
        with(0, Signal::Current, Scale::Engineering),
        with(0, Signal::Ntc, Scale::Engineering),
        with(0, Signal::Ntc, Scale::Raw),
    ]);
    let mut channels = Channels::new();
    let cold = (-1_i16) as u16;
    assert_eq!(
        scan(&mut module, &mut channels),
        [5_001, 12_000, cold, 4_095]
    );
    use ChannelStatus::{Good, OpenCircuit};
    assert_eq!(statuses(&channels), [Good, Good, Good, OpenCircuit]);
}

#[test]
fn status_reports_breaks_and_shorts_while_they_last() {
    use ChannelStatus::{Good, OpenCircuit, OverRange, ShortCircuit, UnderRange};
    let settings = [
        with(0, Signal::Voltage, Scale::Engineering),
        with(0, Signal::Current, Scale::Engineering),
        with(0, Signal::Current, Scale::Raw),
        with(0, Signal::Ntc, Scale::Engineering),
    ];
    let cases = [
        (
            [4095, 0, 700, 0],
            [OverRange, OpenCircuit, UnderRange, ShortCircuit],
        ),
        ([4000, 819, 819, 2048], [Good; 4]),
        (
            [0, 4095, 4095, 4095],
            [Good, OverRange, OverRange, OpenCircuit],
        ),
        (
            [0, 300, 100, 40],
            [Good, UnderRange, OpenCircuit, OverRange],
        ),
        ([0, 2048, 2048, 4060], [Good, Good, Good, UnderRange]),
    ];
    let mut converter = Converter::default();
    for (codes, expected) in cases {
        converter.codes = codes;
        let mut module = Ai4::new(&mut converter);
        module.configure(&settings);
        let mut channels = Channels::new();
        scan(&mut module, &mut channels);
        assert_eq!(statuses(&channels), expected, "{codes:?}");
    }

    // One module for all cases, as when its wires are moved.
    let mut module = Ai4::new(Converter::default());
    module.configure(&settings);
    let mut channels = Channels::new();
    for (codes, expected) in cases {
        module.inputs.source_mut().codes = codes;
        module.read_inputs(&mut channels).unwrap();
        assert_eq!(statuses(&channels), expected, "{codes:?}");
    }
}

#[test]
fn equal_settings_do_not_disturb_a_filter_and_a_new_filter_does_not_jump() {
    let step = |again: bool| {
        let mut module = Ai4::new(Converter::default());
        module.configure(&raw(6));
        let mut channels = Channels::new();
        module.read_inputs(&mut channels).unwrap();
        module.inputs.source_mut().codes = [4000; 4];
        let seen: Vec<u16> = (0..100)
            .map(|_| {
                if again {
                    module.configure(&raw(6));
                }
                module.read_inputs(&mut channels).unwrap();
                channels.word(3)
            })
            .collect();
        (module, channels, seen)
    };
    let (_, _, undisturbed) = step(false);
    let (mut module, mut channels, disturbed) = step(true);
    assert_eq!(undisturbed, disturbed);
    let last = channels.word(3);
    assert!(
        (3100..3300).contains(&last),
        "{last}: 1 - exp(-100/64) of 4000"
    );

    module.configure(&raw(8));
    module.read_inputs(&mut channels).unwrap();
    assert!((last..last + 8).contains(&channels.word(3)));
    module.configure(&[with(8, Signal::Voltage, Scale::Engineering); 4]);
    module.read_inputs(&mut channels).unwrap();
    let mv = u32::from(last) * 10_000 / 4_095;
    assert!((mv..mv + 40).contains(&channels.word(3).into()));
}

#[test]
fn another_range_starts_with_status_good() {
    let mut module = Ai4::new(Converter::default());
    let mut channels = Channels::new();
    let mut show = |signal, codes: [u16; 4]| {
        module.configure(&[with(0, signal, Scale::Raw); 4]);
        module.inputs.source_mut().codes = codes;
        module.read_inputs(&mut channels).unwrap();
        statuses(&channels)
    };
    use ChannelStatus::{Good, OpenCircuit, OverRange, UnderRange};
    // 3650 uA is code 747. It is good, and so is code 4090, unless the status before was worse.
    let worse = [UnderRange, OpenCircuit, Good, Good];
    assert_eq!(show(Signal::Ntc, [4060, 4090, 2048, 2048]), worse);
    assert_eq!(
        show(Signal::Current, [747, 747, 747, 4095]),
        [Good, Good, Good, OverRange]
    );
    assert_eq!(show(Signal::Voltage, [747, 747, 747, 4090]), [Good; 4]);

    let worse = [UnderRange, OpenCircuit, Good, OverRange];
    assert_eq!(show(Signal::Current, [700, 100, 747, 4095]), worse);
    let still = [UnderRange, UnderRange, Good, OverRange];
    assert_eq!(show(Signal::Current, [747, 747, 747, 4090]), still);
}

#[test]
fn a_slow_conversion_is_polled_for_the_same_line_within_the_budget_of_a_scan() {
    let mut module = Ai4::new(Converter {
        codes: [10, 20, 30, 40],
        delay: 20,
        ..Converter::default()
    });
    module.configure(&raw(0));
    let mut channels = Channels::new();
    let mut before = 0;
    for _ in 0..100 {
        module.read_inputs(&mut channels).unwrap();
        let calls = module.inputs.source_mut().calls;
        assert!(calls - before <= u32::from(POLLS_PER_SCAN));
        before = calls;
    }
    assert_eq!(words(&channels), [10, 20, 30, 40]);
    // 6400 calls, of which 21 give one answer.
    let answered = &module.inputs.source_mut().answered;
    assert_eq!(answered.len(), 304);
    assert!(
        answered
            .iter()
            .zip([0, 1, 2, 3].iter().cycle())
            .all(|(a, b)| a == b)
    );
}

/// Returns the error in which every line has failed.
fn all_lines() -> ModuleError {
    let each = (0..CHANNELS).map(|channel| Err(ModuleError::line(channel)));
    each.fold(Ok(()), ModuleError::in_either).unwrap_err()
}

#[test]
fn a_converter_that_does_not_answer_is_reported_until_it_answers() {
    let mut module = Ai4::new(Converter {
        codes: [1, 2, 3, 4],
        ..Converter::default()
    });
    let mut channels = Channels::new();
    module.read_inputs(&mut channels).unwrap();
    module.inputs.source_mut().delay = u32::MAX;
    module.inputs.source_mut().codes = [9; 4];
    for scan in 1..100 {
        let expected = if scan < STALLED_SCANS {
            Ok(())
        } else {
            Err(all_lines())
        };
        assert_eq!(module.read_inputs(&mut channels), expected, "scan {scan}");
        assert_eq!(words(&channels), [1, 2, 3, 4]);
    }
    assert_eq!(
        module.inputs.source_mut().calls,
        4 + 99 * u32::from(POLLS_PER_SCAN)
    );
    module.inputs.source_mut().delay = 0;
    assert_eq!(module.read_inputs(&mut channels), Ok(()));
    assert_eq!(channels.word(0), 9, "the old filter state is discarded");
}

#[test]
fn short_stalls_are_not_added_up() {
    let mut module = Ai4::new(Converter::default());
    let mut channels = Channels::new();
    for _ in 0..10 {
        for delay in [u32::MAX, 0] {
            for _ in 1..STALLED_SCANS {
                module.inputs.source_mut().delay = delay;
                assert_eq!(module.read_inputs(&mut channels), Ok(()));
            }
        }
    }
}

#[test]
fn a_failed_line_is_reported_keeps_its_word_and_restarts_its_filter() {
    let mut module = Ai4::new(Converter {
        codes: [100; 4],
        ..Converter::default()
    });
    module.configure(&raw(8));
    let mut channels = Channels::new();
    module.read_inputs(&mut channels).unwrap();
    module.inputs.source_mut().codes = [4000; 4];
    module.inputs.source_mut().broken[2] = true;
    for _ in 0..300 {
        assert_eq!(module.read_inputs(&mut channels), Err(ModuleError::line(2)));
        assert_eq!(channels.word(2), 100);
    }
    assert!(
        (2700..2900).contains(&channels.word(3)),
        "1 - exp(-300/256)"
    );
    module.inputs.source_mut().broken = [true, false, true, true];
    let failed = module.read_inputs(&mut channels).unwrap_err();
    assert_eq!((failed.channels(), failed.first_line()), (0b1101, Some(0)));
    module.inputs.source_mut().broken = [false; 4];
    assert_eq!(module.read_inputs(&mut channels), Ok(()));
    assert_eq!(channels.word(2), 4000);
}

#[test]
fn a_failed_line_of_a_slow_converter_stays_failed_until_its_next_answer() {
    let mut module = Ai4::new(Converter {
        codes: [1, 2, 3, 4],
        broken: [false, true, false, false],
        delay: 60,
        ..Converter::default()
    });
    let mut channels = Channels::new();
    let results: Vec<_> = (0..40)
        .map(|_| module.read_inputs(&mut channels).is_err())
        .collect();
    let first = results.iter().position(|&failed| failed).unwrap();
    assert!(results[first..].iter().all(|&failed| failed));
    assert_eq!(words(&channels), [1, 0, 3, 4]);
}
