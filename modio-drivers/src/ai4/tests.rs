//! Tests of the driver with the codes of its lines.

extern crate std;
use std::vec::Vec;

use super::*;
use crate::Kind;
use crate::{ChannelStatus, STALLED_SCANS, Scale, Signal};

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
fn scan(module: &mut Ai4, channels: &mut Channels, codes: [u16; 4]) -> [u16; 4] {
    module.read_inputs(channels, &codes.map(Some)).unwrap();
    words(channels)
}

#[test]
fn first_sample_of_every_line_is_shown_immediately() {
    let mut module = Ai4::default();
    let mut channels = Channels::new();
    let codes = [0, 1, 2048, 4095];
    assert_eq!(scan(&mut module, &mut channels, codes), codes);
    assert_eq!(
        module.drive_outputs(&channels, &mut DacLink::default()),
        Ok(())
    );
}

#[test]
fn each_channel_has_its_own_range_and_scale() {
    let mut module = Ai4::default();
    module.configure(&[
        with(0, Signal::Voltage, Scale::Engineering),
        with(0, Signal::Current, Scale::Engineering),
        with(0, Signal::Ntc, Scale::Engineering),
        with(0, Signal::Ntc, Scale::Raw),
    ]);
    let mut channels = Channels::new();
    let cold = (-1_i16) as u16;
    assert_eq!(
        scan(&mut module, &mut channels, [2048, 2457, 3160, 5000]),
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
    for (codes, expected) in cases {
        let mut module = Ai4::default();
        module.configure(&settings);
        let mut channels = Channels::new();
        scan(&mut module, &mut channels, codes);
        assert_eq!(statuses(&channels), expected, "{codes:?}");
    }

    // One module for all cases, as when its wires are moved.
    let mut module = Ai4::default();
    module.configure(&settings);
    let mut channels = Channels::new();
    for (codes, expected) in cases {
        scan(&mut module, &mut channels, codes);
        assert_eq!(statuses(&channels), expected, "{codes:?}");
    }
}

#[test]
fn equal_settings_do_not_disturb_a_filter_and_a_new_filter_does_not_jump() {
    let step = |again: bool| {
        let mut module = Ai4::default();
        module.configure(&raw(6));
        let mut channels = Channels::new();
        scan(&mut module, &mut channels, [0; 4]);
        let seen: Vec<u16> = (0..100)
            .map(|_| {
                if again {
                    module.configure(&raw(6));
                }
                scan(&mut module, &mut channels, [4000; 4])[3]
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
    scan(&mut module, &mut channels, [4000; 4]);
    assert!((last..last + 8).contains(&channels.word(3)));
    module.configure(&[with(8, Signal::Voltage, Scale::Engineering); 4]);
    scan(&mut module, &mut channels, [4000; 4]);
    let mv = u32::from(last) * 10_000 / 4_095;
    assert!((mv..mv + 40).contains(&channels.word(3).into()));
}

#[test]
fn another_range_starts_with_status_good() {
    let mut module = Ai4::default();
    let mut channels = Channels::new();
    let mut show = |signal, codes: [u16; 4]| {
        module.configure(&[with(0, signal, Scale::Raw); 4]);
        scan(&mut module, &mut channels, codes);
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
fn a_line_without_codes_is_reported_keeps_its_word_and_restarts_its_filter() {
    let mut module = Ai4::default();
    module.configure(&raw(8));
    let mut channels = Channels::new();
    scan(&mut module, &mut channels, [100; 4]);
    for missed in 1..=300_u16 {
        let codes = [Some(4000), Some(4000), None, Some(4000)];
        let expected = if missed < u16::from(STALLED_SCANS) {
            Ok(())
        } else {
            Err(ModuleError::line(2))
        };
        let result = module.read_inputs(&mut channels, &codes);
        assert_eq!(result, expected, "{missed} scans without a code");
        assert_eq!(channels.word(2), 100);
    }
    assert!(
        (2700..2900).contains(&channels.word(3)),
        "1 - exp(-300/256)"
    );
    assert_eq!(scan(&mut module, &mut channels, [4000; 4])[2], 4000);
}

#[test]
fn short_stalls_are_not_added_up() {
    let mut module = Ai4::default();
    let mut channels = Channels::new();
    for _ in 0..10 {
        for _ in 1..STALLED_SCANS {
            assert_eq!(module.read_inputs(&mut channels, &[None; 4]), Ok(()));
        }
        scan(&mut module, &mut channels, [0; 4]);
    }
}
