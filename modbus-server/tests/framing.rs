//! Valid and damaged frames (V1.02 2.4.2, 2.5.1). After every kind of damage, a silence and then a valid request
//! must be answered.

mod common;

use common::{Points, UNIT, Unit, crc, frame, pdu};
use modbus_server::line::{Faults, Receiver};

fn unit() -> Unit {
    Unit::new(Points::new(64, 64))
}

/// A read of one word.
fn request() -> Vec<u8> {
    frame(UNIT, &pdu(0x03, &[0, 1]))
}

/// Sends bytes that must be ignored and counted as one error.
fn is_an_error(unit: &mut Unit, bytes: &[u8]) {
    let before = unit.counters().communication_errors;
    assert_eq!(unit.raw(bytes), None, "{bytes:02X?}");
    assert_eq!(unit.counters().communication_errors, before + 1);
    unit.must_answer();
}

#[test]
fn every_single_bit_error_is_detected() {
    let mut unit = unit();
    let good = request();
    for bit in 0..good.len() * 8 {
        let mut bad = good.clone();
        bad[bit / 8] ^= 1 << (bit % 8);
        is_an_error(&mut unit, &bad);
    }
    assert_eq!(unit.raw(&good).unwrap().len(), 7);
}

#[test]
fn a_swapped_crc_gets_silence() {
    let mut swapped = request();
    let len = swapped.len();
    swapped.swap(len - 1, len - 2);
    assert_ne!(swapped, request());
    is_an_error(&mut unit(), &swapped);
}

#[test]
fn an_unknown_function_with_a_wrong_crc_is_not_answered() {
    let mut bad = frame(UNIT, &[0x63, 0, 0]);
    bad[2] ^= 1;
    is_an_error(&mut unit(), &bad);
}

#[test]
fn one_to_three_bytes_are_an_error_even_with_a_valid_crc() {
    let mut unit = unit();
    for noise in [&[0x00][..], &[0xFF], &[UNIT, 0x03], &[0x00, 0x00, 0x00]] {
        is_an_error(&mut unit, noise);
    }
    let [low, high] = crc(&[UNIT]);
    is_an_error(&mut unit, &[UNIT, low, high]);
    // Two bytes that are the valid CRC of an empty frame.
    is_an_error(&mut unit, &[0xFF, 0xFF]);
}

#[test]
fn a_frame_of_256_bytes_is_processed() {
    let mut unit = unit();
    let longest = [&[0x63][..], &[0x55; 252]].concat();
    assert_eq!(frame(UNIT, &longest).len(), 256);
    assert_eq!(unit.request(&longest).unwrap(), [0xE3, 0x01]);
}

#[test]
fn longer_frames_are_dropped_up_to_the_next_silence() {
    for len in [257, 258, 300, 512, 513, 1000, 70_000] {
        let mut unit = unit();
        let body = [&[UNIT, 0x63][..], &vec![0x55; len - 4]].concat();
        let too_long = [&body[..], &crc(&body)].concat();
        assert_eq!(too_long.len(), len);
        is_an_error(&mut unit, &too_long);

        // This also holds when the bytes end with a valid request.
        let joined = [&vec![0x55; len][..], &request()].concat();
        is_an_error(&mut unit, &joined);
    }
}

#[test]
fn requests_without_silence_between_them_are_both_lost() {
    let joined = [request(), request()].concat();
    is_an_error(&mut unit(), &joined);
    let joined = [frame(UNIT + 1, &[0x03, 0, 0, 0, 1]), request()].concat();
    is_an_error(&mut unit(), &joined);
}

#[test]
fn a_stray_byte_damages_only_the_frame_that_it_joins() {
    let joined = [&[0x00][..], &request()].concat();
    is_an_error(&mut unit(), &joined);
}

#[test]
fn a_truncated_frame_is_discarded() {
    let mut unit = unit();
    for len in 1..request().len() {
        is_an_error(&mut unit, &request()[..len]);
    }
}

#[test]
fn a_faulty_character_anywhere_damages_its_frame() {
    for faults in [
        Faults::PARITY,
        Faults::FRAMING,
        Faults::OVERRUN,
        Faults::PARITY | Faults::FRAMING,
        Faults::PARITY | Faults::NOISE,
    ] {
        for at in 0..request().len() {
            let mut unit = unit();
            for (index, byte) in request().into_iter().enumerate() {
                let faults = if index == at { faults } else { Faults::NONE };
                unit.character(byte, faults);
            }
            assert_eq!(unit.silence(), None);
            let counters = unit.counters();
            assert_eq!(
                (counters.communication_errors, counters.bus_messages),
                (1, 0)
            );
            assert_eq!(counters.overruns, u16::from(faults == Faults::OVERRUN));
            unit.must_answer();
        }
    }
}

#[test]
fn noise_flag_alone_does_not_damage_a_frame_with_a_valid_crc() {
    for strict in [false, true] {
        for at in 0..=request().len() {
            let mut unit = Unit::with(UNIT, strict, Points::new(64, 64));
            for (index, byte) in request().into_iter().enumerate() {
                // In the last round every character has the noise flag.
                let noisy = index == at || at == request().len();
                let faults = if noisy { Faults::NOISE } else { Faults::NONE };
                unit.character(byte, faults);
            }
            assert!(unit.silence().is_some(), "noise at {at}");
            let words = unit.counters().as_words();
            assert_eq!(words, [1, 0, 0, 1, 0, 0, 0, 0, 0], "noise at {at}");
        }
    }
}

#[test]
fn noise_flag_does_not_make_a_wrong_crc_valid() {
    let mut unit = unit();
    let mut bad = request();
    bad[3] ^= 1;
    for byte in bad {
        unit.character(byte, Faults::NOISE);
    }
    assert_eq!(unit.silence(), None);
    assert_eq!(unit.counters().communication_errors, 1);
    unit.must_answer();
}

#[test]
fn power_up_during_traffic_waits_for_silence() {
    let mut receiver = Receiver::rtu(UNIT, false);
    receiver.give_back(Box::leak(Box::default()));
    let mut receive = |bytes: &[u8]| {
        bytes.iter().for_each(|byte| {
            receiver.character(*byte, Faults::NONE);
        });
    };
    receive(&request());
    receive(&[0x00; 300]);
    receive(&request());
    receiver.pause();
    receiver.character(0, Faults::FRAMING);
    assert!(
        receiver.close().is_none(),
        "the first silence returns no frame"
    );
    assert_eq!(
        *receiver.counters(),
        Default::default(),
        "nothing was counted"
    );
    request().iter().for_each(|byte| {
        receiver.character(*byte, Faults::NONE);
    });
    assert!(receiver.close().is_some());
}

#[test]
fn silence_without_a_frame_is_ignored() {
    let mut unit = unit();
    for _ in 0..3 {
        assert_eq!(unit.silence(), None);
    }
    assert_eq!(*unit.port.counters(), Default::default());
    unit.must_answer();
}

#[test]
fn a_gap_above_t15_is_counted_and_tolerated() {
    let mut unit = unit();
    for (index, byte) in request().into_iter().enumerate() {
        if index > 0 {
            unit.pause();
        }
        unit.character(byte, Faults::NONE);
    }
    assert!(unit.silence().is_some());
    assert_eq!(unit.counters().gaps, 7);
    assert_eq!(unit.counters().bus_messages, 1);
}

#[test]
fn a_gap_above_t15_drops_the_frame_in_strict_mode() {
    for at in 1..request().len() {
        let mut unit = Unit::with(UNIT, true, Points::new(64, 64));
        unit.characters(&request()[..at]);
        unit.pause();
        unit.characters(&request()[at..]);
        assert_eq!(unit.silence(), None);
        let counters = unit.counters();
        assert_eq!(counters.gaps, 1);
        // Its CRC was valid: it was a message to this unit and got no response.
        assert_eq!((counters.unit_messages, counters.no_response), (1, 1));
        assert_eq!(
            (counters.bus_messages, counters.communication_errors),
            (1, 0)
        );
        unit.must_answer();
    }
}

#[test]
fn a_frame_that_looked_complete_at_t15_may_continue() {
    // A valid write, and then more characters that make it a valid frame of another kind.
    let mut unit = unit();
    let first = frame(UNIT, &pdu(0x06, &[1, 0x0BAD]));
    unit.characters(&first);
    unit.pause();
    unit.pause();
    let whole = [&first[..], &[0x99]].concat();
    let end = crc(&whole);
    unit.characters(&[0x99]);
    unit.pause();
    unit.characters(&end);
    let reply = unit.silence().expect("the CRC is valid");
    assert_eq!(
        reply[1..3],
        [0x86, 0x03],
        "the PDU is too long for function 06"
    );
    assert_eq!(unit.points.words[1], 0);
    assert_eq!(unit.counters().gaps, 2);
}

#[test]
fn a_frame_of_256_bytes_that_continues_is_too_long() {
    let mut unit = unit();
    unit.characters(&frame(UNIT, &[&[0x63][..], &[0x55; 252]].concat()));
    unit.pause();
    unit.characters(&[0]);
    assert_eq!(unit.silence(), None);
    assert_eq!(unit.counters().communication_errors, 1);
    unit.must_answer();
}

#[test]
fn the_unit_receives_immediately_after_its_own_reply() {
    let mut unit = unit();
    unit.characters(&[0x55, 0x55]); // the echo of the unit's reply, if the receiver was late
    unit.port.sent();
    unit.must_answer();
    assert_eq!(unit.counters().communication_errors, 0);
}
