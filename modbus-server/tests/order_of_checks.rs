//! The priority of exceptions when several apply: function 01, then quantity, byte count and value form 03, then
//! address 02, then value range 03, then state 04 or 06 (V1.1b3 section 6, flow charts). A request is never
//! executed partly.

mod common;

use common::{MAX_WORD, Points, Unit, frame, pdu, write_bits, write_words};
use modbus_server::Exception;

/// Returns a unit with ten points of each kind; the last two cannot be written.
fn ten() -> Unit {
    let mut points = Points::new(10, 10);
    points.read_only_from = 8;
    Unit::new(points)
}

#[test]
fn a_range_one_past_the_end_is_02() {
    let mut unit = ten();
    for function in 0x01..=0x04 {
        assert!(unit.request(&pdu(function, &[9, 1])).unwrap()[0] == function);
        assert_eq!(unit.refused(&pdu(function, &[9, 2])), 2);
        assert_eq!(unit.refused(&pdu(function, &[10, 1])), 2);
    }
    assert_eq!(unit.refused(&pdu(0x05, &[10, 0xFF00])), 2);
    assert_eq!(unit.refused(&pdu(0x06, &[10, 1])), 2);
    assert_eq!(unit.refused(&write_bits(9, &[true, true])), 2);
    assert_eq!(unit.refused(&write_words(9, &[1, 1])), 2);
}

#[test]
fn a_write_that_reaches_a_read_only_point_is_02_and_writes_nothing() {
    let mut unit = ten();
    assert_eq!(unit.refused(&pdu(0x05, &[8, 0xFF00])), 2);
    assert_eq!(unit.refused(&pdu(0x06, &[8, 1])), 2);
    assert_eq!(unit.refused(&write_bits(0, &[true; 9])), 2);
    assert_eq!(unit.refused(&write_words(0, &[1; 9])), 2);
    assert_eq!(
        unit.request(&write_words(0, &[1; 8])).unwrap(),
        pdu(0x10, &[0, 8])
    );
}

#[test]
fn quantity_is_checked_before_address() {
    let mut unit = ten();
    for function in 0x01..=0x04 {
        assert_eq!(unit.refused(&pdu(function, &[0xFFFF, 0])), 3);
        assert_eq!(unit.refused(&pdu(function, &[0xFFFF, 2001])), 3);
        assert_eq!(unit.refused(&pdu(function, &[0x1000, 0xFFFF])), 3);
    }
    assert_eq!(unit.refused(&write_bits(0xFFFF, &[true; 1969])), 3);
    assert_eq!(unit.refused(&write_words(0xFFFF, &[])), 3);
}

#[test]
fn byte_count_is_checked_before_address() {
    let mut unit = ten();
    assert_eq!(
        unit.refused(&[0x0F, 0xFF, 0xFF, 0x00, 0x0A, 0x03, 1, 2, 3]),
        3
    );
    assert_eq!(
        unit.refused(&[0x10, 0xFF, 0xFF, 0x00, 0x02, 0x03, 1, 2, 3]),
        3
    );
}

#[test]
fn the_form_of_a_single_bit_is_checked_before_its_address() {
    assert_eq!(ten().refused(&pdu(0x05, &[0xFFFF, 0x1234])), 3);
}

#[test]
fn address_is_checked_before_value_range() {
    let mut unit = ten();
    assert_eq!(unit.refused(&pdu(0x06, &[10, MAX_WORD + 1])), 2);
    assert_eq!(unit.refused(&write_words(7, &[MAX_WORD + 1, 0])), 2);
    assert_eq!(unit.refused(&pdu(0x06, &[7, MAX_WORD + 1])), 3);
    assert_eq!(unit.refused(&write_words(6, &[1, MAX_WORD + 1])), 3);
}

#[test]
fn value_range_is_checked_before_state() {
    for state in [
        Exception::ServerDeviceFailure,
        Exception::ServerDeviceBusy,
        Exception::MemoryParityError,
        Exception::GatewayTargetDeviceFailedToRespond,
    ] {
        let mut unit = ten();
        unit.points.state = Some(state.code());
        assert_eq!(unit.refused(&pdu(0x06, &[0, MAX_WORD + 1])), 3);
        assert_eq!(unit.refused(&pdu(0x06, &[10, 1])), 2);
        for request in [
            pdu(0x01, &[0, 1]),
            pdu(0x03, &[0, 1]),
            pdu(0x05, &[0, 0xFF00]),
            pdu(0x06, &[0, 1]),
            write_bits(0, &[true]),
            write_words(0, &[1]),
        ] {
            assert_eq!(unit.refused(&request), state.code());
        }
    }
}

#[test]
fn every_unknown_function_returns_01_with_any_data() {
    let known = [
        1, 2, 3, 4, 5, 6, 7, 8, 0x0B, 0x0C, 0x0F, 0x10, 0x11, 0x16, 0x17, 0x2B,
    ];
    let mut unit = ten();
    for function in (0x01..=0x7F).filter(|code| !known.contains(code)) {
        for rest in [&[][..], &[0], &[0, 0, 0, 1], &[0xFF; 252]] {
            let request = [&[function][..], rest].concat();
            assert_eq!(unit.refused(&request), 1, "{function:02X}");
        }
    }
}

#[test]
fn an_invalid_function_code_gets_silence() {
    let mut unit = ten();
    for function in (0x80..=0xFF).chain([0x00]) {
        assert_eq!(
            unit.request(&pdu(function, &[0, 1])),
            None,
            "{function:02X}"
        );
    }
    assert_eq!(unit.counters().exceptions, 0);
    assert_eq!(unit.counters().no_response, 129);
}

#[test]
fn a_broadcast_is_executed_without_reply() {
    let mut unit = ten();
    assert_eq!(unit.raw(&frame(0, &pdu(0x05, &[3, 0xFF00]))), None);
    assert_eq!(unit.raw(&frame(0, &pdu(0x06, &[1, 0x0111]))), None);
    assert_eq!(
        unit.raw(&frame(0, &write_bits(4, &[true, false, true]))),
        None
    );
    assert_eq!(
        unit.raw(&frame(0, &write_words(2, &[0x0222, 0x0333]))),
        None
    );
    assert_eq!(unit.points.bits[3..8], [true, true, false, true, false]);
    assert_eq!(unit.points.words[..5], [0, 0x0111, 0x0222, 0x0333, 0]);
}

#[test]
fn a_broadcast_that_reads_or_is_invalid_has_no_effect() {
    let mut unit = ten();
    let points = unit.points.clone();
    for request in [
        pdu(0x01, &[0, 1]),
        pdu(0x04, &[0, 1]),
        pdu(0x03, &[0, 0]),
        pdu(0x05, &[0, 0x1234]),
        pdu(0x06, &[8, 1]),
        write_words(7, &[1, 1]),
        vec![0x7F],
        vec![0x00],
        vec![0x83, 0x02],
    ] {
        assert_eq!(unit.raw(&frame(0, &request)), None, "{request:02X?}");
        assert_eq!(unit.points, points, "{request:02X?}");
    }
    unit.must_answer();
}
