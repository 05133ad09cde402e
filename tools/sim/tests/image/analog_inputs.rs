//! Analog inputs on the converter: channels in different units, one with a signal fault, and the source's resistance. Every
//! code in every RANGE and SCALE, and the low-pass, are tested on the host, in `modio-drivers`.

use register_map::configuration::{FILTER, RANGE, SCALE};
use sim::{Module, Time};

use crate::rig::{Rig, SLOT, corner};

const STATUS: u16 = 0x0240 + SLOT;

const VOLTS: u16 = 0;
const CURRENT: u16 = 1;
const NTC: u16 = 2;

const GOOD: u16 = 0;
const OPEN: u16 = 3;

/// A 4AI module whose channels follow their pins without delay.
fn rig() -> Rig {
    let filters: Vec<_> = (0..4).map(|n| (FILTER + SLOT + n, 0)).collect();
    Rig::set_up(Module::Ai4, &filters)
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn fault_of_a_channel_changes_only_the_status_of_that_channel() {
    let mut rig = rig();
    rig.configure(RANGE + SLOT, &[VOLTS, CURRENT, NTC, CURRENT]);
    rig.configure(SCALE + SLOT, &[1, 1, 1, 0]);
    for (channel, millivolts) in [(1, 1650), (2, 0), (3, 1650), (4, 660)] {
        rig.board.set_millivolts(channel, millivolts).unwrap();
    }
    rig.board.run_for(Time::from_ms(5));
    assert_eq!(rig.registers(STATUS, 4), Ok(vec![GOOD, OPEN, GOOD, GOOD]));
    let words = rig.registers(SLOT, 4).unwrap();
    for (word, (expected, slack)) in words.iter().zip([(5000, 2), (0, 0), (250, 1), (819, 1)]) {
        // One LSB of noise is up to 5 units.
        let slack = slack + 5 * corner().adc_noise();
        assert!(word.abs_diff(expected) <= slack, "{words:?}");
    }
    // Points that do not exist have no status.
    assert_eq!(rig.registers(0x0240, 16), Ok(vec![0; 16]));
    assert_eq!(rig.registers(0x0254, 12), Ok(vec![0; 12]));
}

/// The unit samples for 55.5 cycles at 12 MHz, which allows sources of up to 50 kOhm (DS5319, RAIN against the
/// sampling time).
#[test]
#[ignore = "needs the image: cargo xtask test"]
fn source_of_50_kohm_reads_correctly_and_source_of_500_kohm_does_not() {
    let mut rig = rig();
    for (channel, millivolts) in [(1, 0), (2, 3300), (3, 0), (4, 3300)] {
        rig.board.set_millivolts(channel, millivolts).unwrap();
        rig.board.set_source_ohms(channel, 50_000).unwrap();
    }
    rig.board.run_for(Time::from_ms(200));
    // The noise of the converter at a corner is 2 LSB.
    let is_right = |word: u16, right: u16| word.abs_diff(right) <= 2;
    let read = rig.registers(SLOT, 4).unwrap();
    assert!(is_right(read[0], 0) && is_right(read[1], 4095), "{read:?}");
    assert!(is_right(read[2], 0) && is_right(read[3], 4095), "{read:?}");
    rig.board.set_source_ohms(3, 500_000).unwrap();
    rig.board.run_for(Time::from_ms(200));
    let read = rig.registers(SLOT, 4).unwrap();
    assert!(is_right(read[0], 0) && is_right(read[1], 4095), "{read:?}");
    assert!(is_right(read[3], 4095), "{read:?}");
    assert!(read[2] > 500, "{}", read[2]);
}
