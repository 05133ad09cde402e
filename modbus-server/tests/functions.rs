//! The effect and the limits of the functions that access points (V1.1b3 section 6).
//!
//! Checks have an order: function 01, then quantity, byte count and value form 03, then address 02, then value range
//! 03, then the state of the device. So each table of requests has everything wrong that a later check would find.

mod common;

use common::{
    MAX_WORD, Points, UNIT, Unit, frame, pack, pdu, write_bits, write_then_read, write_words,
};
use modbus_server::line::{Framing, Receiver};
use modbus_server::{BitsOut, DataModel, Exception, Span, Table, WordsOut};

/// Returns a unit with a point at every address.
fn full() -> Unit {
    Unit::new(Points::new(0x1_0000, 0x1_0000))
}

/// Returns a unit with ten points of each kind, of which the last two cannot be written. It is in a state in which it
/// serves no request.
fn busy() -> Unit {
    let mut points = Points::new(10, 10);
    points.read_only_from = 8;
    points.state = Some(Exception::ServerDeviceBusy.code());
    Unit::new(points)
}

/// A value out of range, and an address without a point.
const BEYOND: u16 = MAX_WORD + 1;
const NOWHERE: u16 = 0xFFFF;

/// Valid requests of every function that accesses points.
fn valid() -> [Vec<u8>; 10] {
    [
        pdu(0x01, &[0, 8]),
        pdu(0x02, &[0, 8]),
        pdu(0x03, &[0, 1]),
        pdu(0x04, &[0, 1]),
        pdu(0x05, &[0, 0xFF00]),
        pdu(0x06, &[0, 1]),
        write_bits(0, &[true; 8]),
        write_words(0, &[1, 2]),
        pdu(0x16, &[0, 0xFFFF, 0]),
        write_then_read(0, 2, 4, &[1, 2, 3]),
    ]
}

#[test]
fn bits_are_read_packed_from_bit_0_with_padding_of_zeros() {
    for function in [0x01, 0x02] {
        let mut unit = full();
        let bits = unit.points.bits_of(function);
        bits.iter_mut()
            .skip(1)
            .step_by(3)
            .for_each(|bit| *bit = true);
        for (start, count) in [(20, 11), (0, 1), (0, 2000), (0xFFFF, 1)] {
            let reply = unit.request(&pdu(function, &[start, count])).unwrap();
            let from = usize::from(start);
            let packed = pack(&unit.points.bits_of(function)[from..from + usize::from(count)]);
            assert_eq!(
                reply,
                [&[function, packed.len() as u8], &packed[..]].concat()
            );
        }
    }
}

#[test]
fn words_are_read_high_byte_first() {
    for function in [0x03, 0x04] {
        let mut unit = full();
        let words = unit.points.words_of(function);
        (0..0x1_0000).for_each(|n| words[n] = (n * 0x0203) as u16);
        for (start, count) in [(0x1234, 2), (0, 125), (0xFFFF, 1)] {
            let reply = unit.request(&pdu(function, &[start, count])).unwrap();
            let from = usize::from(start);
            let words = &unit.points.words_of(function)[from..from + usize::from(count)];
            let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_be_bytes()).collect();
            assert_eq!(reply, [&[function, bytes.len() as u8], &bytes[..]].concat());
        }
    }
}

#[test]
fn single_writes_are_executed_and_echoed() {
    let mut unit = full();
    for address in [172, 0xFFFF] {
        for (value, on) in [(0xFF00, true), (0, false)] {
            let request = pdu(0x05, &[address, value]);
            assert_eq!(unit.request(&request).unwrap(), request);
            assert_eq!(unit.points.bits[usize::from(address)], on);
        }
        let request = pdu(0x06, &[address, 0x1234]);
        assert_eq!(unit.request(&request).unwrap(), request);
        assert_eq!(unit.points.words[usize::from(address)], 0x1234);
    }
    assert!(
        unit.points.bits.iter().all(|bit| !bit),
        "no other bit changes"
    );
    let written = unit.points.words.iter().filter(|word| **word != 0).count();
    assert_eq!(written, 2, "no other word changes");
}

#[test]
fn several_points_are_written_up_to_1968_bits_and_123_words() {
    let mut unit = full();
    for (start, count) in [(5, 1968), (0xFFFF, 1)] {
        let bits: Vec<bool> = (0..count).map(|n| n % 7 < 3).collect();
        let reply = unit.request(&write_bits(start, &bits));
        assert_eq!(reply, Some(pdu(0x0F, &[start, count])));
        assert_eq!(unit.points.bits[usize::from(start)..][..bits.len()], bits);
    }
    for (start, count) in [(0xFF00, 123), (0xFFFF, 1)] {
        let words: Vec<u16> = (0..count).map(|n| n * 0x0101).collect();
        let reply = unit.request(&write_words(start, &words));
        assert_eq!(reply, Some(pdu(0x10, &[start, count])));
        assert_eq!(
            unit.points.words[usize::from(start)..][..words.len()],
            words
        );
    }
    // The standard's own example (6.11): ten bits from 19 on, here with the padding set, which is ignored.
    unit.points.bits.fill(false);
    unit.points.bits[29] = true;
    unit.request(&[0x0F, 0x00, 0x13, 0x00, 0x0A, 0x02, 0xCD, 0xFD])
        .unwrap();
    assert_eq!(
        unit.points.bits[18..31],
        [0, 1, 0, 1, 1, 0, 0, 1, 1, 1, 0, 1, 0].map(|bit| bit == 1)
    );
}

#[test]
fn the_and_mask_selects_the_bits_of_the_or_mask() {
    let mut unit = full();
    for (now, and, or, then) in [
        (0x0012, 0x00F2, 0x0025, 0x0017), // the standard's example
        (0xABCD, 0xFFFF, 0xFFFF, 0xABCD),
        (0xABCD, 0x0000, 0x1234, 0x1234),
        (0xABCD, 0x00FF, 0x1234, 0x12CD),
    ] {
        unit.points.words[9] = now;
        let request = pdu(0x16, &[9, and, or]);
        assert_eq!(unit.request(&request), Some(request));
        assert_eq!(unit.points.words[8..11], [0, then, 0]);
    }
}

#[test]
fn up_to_121_words_are_written_before_up_to_125_are_read() {
    let mut unit = full();
    let words: Vec<u16> = (0..121).map(|n| n * 3).collect();
    let reply = unit.request(&write_then_read(0xFF00, 125, 0xFF04, &words));
    let data = [&[0; 4][..], &words].concat();
    let bytes: Vec<u8> = data.iter().flat_map(|word| word.to_be_bytes()).collect();
    assert_eq!(reply, Some([&[0x17, 250], &bytes[..]].concat()));
    assert_eq!(unit.points.words[0xFF04..0xFF04 + 121], words);
}

#[test]
fn requests_with_a_wrong_form_are_03_before_any_other_check() {
    let coil = |value| pdu(0x05, &[NOWHERE, value]);
    let mut wrong: Vec<Vec<u8>> = [0x0001, 0x1234, 0xFF01, 0x00FF, 0xFFFF, 0x0100]
        .map(coil)
        .to_vec();
    for (function, most) in [(1, 2000), (2, 2000), (3, 125), (4, 125)] {
        wrong.extend([0, most + 1, 0xFFFF].map(|count| pdu(function, &[NOWHERE, count])));
    }
    wrong.extend([write_bits(NOWHERE, &[]), write_bits(NOWHERE, &[true; 1969])]);
    wrong.push(write_words(NOWHERE, &[]));
    for (read, words) in [(0, 2), (126, 2), (2, 0)] {
        wrong.push(write_then_read(
            NOWHERE,
            read,
            NOWHERE,
            &vec![BEYOND; words],
        ));
    }
    // One word more than fits a frame, truncated to what fits.
    wrong.push(write_words(0, &[1; 124])[..253].to_vec());
    wrong.push(write_then_read(0, 1, 0, &[1; 122])[..253].to_vec());
    // The byte count does not fit the quantity. The request has as many bytes as the count says, fewer, or more.
    for (count, data) in [
        (0, 0),
        (1, 1),
        (1, 2),
        (3, 3),
        (3, 2),
        (2, 3),
        (255, 2),
        (255, 247),
    ] {
        for (function, quantity) in [(0x0F, 10), (0x10, 1)] {
            let head = [&pdu(function, &[NOWHERE, quantity])[..], &[count]].concat();
            wrong.push([head, vec![0x55; data]].concat());
        }
    }
    for count in (0..=255).filter(|count| *count != 6) {
        let mut both = write_then_read(NOWHERE, 2, NOWHERE, &[1, 2, 3]);
        both[9] = count;
        wrong.push(both);
    }
    for request in valid() {
        wrong.extend((1..request.len()).map(|len| request[..len].to_vec()));
        wrong.extend([0x00, 0xFF].map(|extra| [&request[..], &[extra]].concat()));
    }
    for request in wrong {
        assert_eq!(busy().refused(&request), 3, "{request:02X?}");
    }
}

#[test]
fn ranges_that_reach_a_point_which_does_not_exist_or_cannot_be_written_are_02() {
    for request in [
        pdu(0x01, &[9, 2]),
        pdu(0x02, &[10, 1]),
        pdu(0x03, &[9, 2]),
        pdu(0x04, &[NOWHERE, 2]),
        pdu(0x05, &[8, 0xFF00]),
        pdu(0x05, &[10, 0xFF00]),
        pdu(0x06, &[8, BEYOND]),
        pdu(0x06, &[10, BEYOND]),
        write_bits(0, &[true; 9]),
        write_bits(NOWHERE, &[true; 2]),
        write_words(7, &[BEYOND, 0]),
        write_words(NOWHERE, &[BEYOND; 2]),
        pdu(0x16, &[8, 0, BEYOND]),
        pdu(0x16, &[10, 0, BEYOND]),
        write_then_read(9, 2, 0, &[BEYOND]),
        write_then_read(NOWHERE, 2, 0, &[BEYOND]),
        write_then_read(0, 1, 7, &[BEYOND, 2]),
        write_then_read(0, 1, NOWHERE, &[BEYOND, 2]),
    ] {
        assert_eq!(busy().refused(&request), 2, "{request:02X?}");
    }
    // No range wraps, even where there is a point at every address.
    for function in 0x01..=0x04 {
        assert_eq!(full().refused(&pdu(function, &[0xFFFF, 2])), 2);
    }
    assert_eq!(full().refused(&write_bits(0xFFFF, &[true; 2])), 2);
    assert_eq!(full().refused(&write_words(0xFFFF, &[1; 2])), 2);
}

#[test]
fn values_out_of_range_are_03_before_the_state_is_checked() {
    for request in [
        pdu(0x06, &[7, BEYOND]),
        write_words(6, &[1, BEYOND]),
        write_then_read(0, 1, 7, &[BEYOND]),
    ] {
        assert_eq!(busy().refused(&request), 3, "{request:02X?}");
    }
    // A value that cannot be read cannot be masked.
    let mask = pdu(0x16, &[7, 0, BEYOND]);
    let mut unit = busy();
    assert_eq!(unit.refused(&mask), 6);
    unit.points.state = None;
    assert_eq!(unit.refused(&mask), 3);
}

#[test]
fn a_state_of_the_device_refuses_valid_requests() {
    for state in [
        Exception::ServerDeviceFailure,
        Exception::ServerDeviceBusy,
        Exception::MemoryParityError,
        Exception::GatewayTargetDeviceFailedToRespond,
    ] {
        let mut unit = busy();
        unit.points.state = Some(state.code());
        for request in valid() {
            assert_eq!(unit.refused(&request), state.code());
        }
    }
}

#[test]
fn every_unknown_function_returns_01_with_any_data() {
    let known = [
        1, 2, 3, 4, 5, 6, 7, 8, 0x0B, 0x0C, 0x0F, 0x10, 0x11, 0x16, 0x17, 0x2B,
    ];
    let mut unit = busy();
    for function in (0x01..=0x7F).filter(|code| !known.contains(code)) {
        for rest in [&[][..], &[0], &[0, 0, 0, 1], &[0xFF; 252]] {
            let request = [&[function][..], rest].concat();
            assert_eq!(unit.refused(&request), 1, "{function:02X}");
        }
    }
}

#[test]
fn an_invalid_function_code_gets_silence() {
    let mut unit = full();
    for function in (0x80..=0xFF).chain([0x00]) {
        let reply = unit.request(&pdu(function, &[0, 1]));
        assert_eq!(reply, None, "{function:02X}");
    }
    assert_eq!(unit.counters().exceptions, 0);
    assert_eq!(unit.counters().no_response, 129);
}

#[test]
fn a_broadcast_write_is_executed_in_silence_and_any_other_has_no_effect() {
    let mut unit = full();
    for request in [
        pdu(0x05, &[3, 0xFF00]),
        pdu(0x06, &[1, 0x0111]),
        write_bits(4, &[true, false, true]),
        write_words(2, &[0x0222, 0x0333]),
        pdu(0x16, &[1, 0xFFF0, 0x0007]),
    ] {
        assert_eq!(unit.raw(&frame(0, &request)), None);
    }
    assert_eq!(unit.points.bits[3..8], [true, true, false, true, false]);
    assert_eq!(unit.points.words[..5], [0, 0x0117, 0x0222, 0x0333, 0]);
    unit.points.read_only_from = 8;
    let points = unit.points.clone();
    for request in [
        pdu(0x01, &[0, 1]),
        pdu(0x03, &[0, 0]),
        pdu(0x05, &[0, 0x1234]),
        pdu(0x06, &[8, 1]),
        write_words(7, &[1, 1]),
        write_then_read(0, 1, 4, &[9]),
        vec![0x7F],
        vec![0x00],
        vec![0x83, 0x02],
    ] {
        assert_eq!(unit.raw(&frame(0, &request)), None, "{request:02X?}");
        assert_eq!(unit.points, points, "{request:02X?}");
    }
    unit.must_answer();
}

#[test]
fn a_model_that_pushes_too_little_or_too_much_leaks_nothing() {
    /// Pushes two words for every request, and more bits than fit.
    struct Careless;
    impl DataModel for Careless {
        fn check_read_bits(&self, _: Table, _: Span) -> Result<(), Exception> {
            Ok(())
        }
        fn check_read_words(&self, _: Table, _: Span) -> Result<(), Exception> {
            Ok(())
        }
        fn read_bits(&self, _: Table, _: Span, out: &mut BitsOut<'_>) {
            (0..100).for_each(|_| out.push(true));
        }
        fn read_words(&self, _: Table, _: Span, out: &mut WordsOut<'_>) {
            out.push(0x0101);
            out.push(0x0202);
        }
    }

    let mut unit = Unit::over(Receiver::rtu(UNIT, false), Framing::Rtu, Careless);
    for (function, quantity, body) in [
        (0x03, 1, &[1, 1][..]),
        (0x03, 4, &[1, 1, 2, 2, 0, 0, 0, 0]),
        (0x01, 3, &[0b111]),
    ] {
        let reply = unit.request(&pdu(function, &[0xFFF0, quantity]));
        let expected = [&[function, body.len() as u8], body].concat();
        assert_eq!(reply, Some(expected));
    }
}
