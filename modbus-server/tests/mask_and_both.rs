//! Functions 16, mask write, and 17, read and write in one request (V1.1b3 6.16, 6.17).

mod common;

use common::{MAX_WORD, Points, UNIT, Unit, frame, pdu, write_then_read};
use modbus_server::Exception;

fn full() -> Unit {
    Unit::new(Points::new(4, 0x1_0000))
}

#[test]
fn the_standards_mask_changes_12_to_17() {
    let mut unit = full();
    unit.points.words[4] = 0x12;
    let request = pdu(0x16, &[4, 0xF2, 0x25]);
    assert_eq!(unit.request(&request), Some(request));
    assert_eq!(unit.points.words[3..6], [0, 0x17, 0]);
}

#[test]
fn the_and_mask_selects_the_bits_of_the_or_mask() {
    let mut unit = full();
    for (now, and, or, then) in [
        (0xABCD, 0xFFFF, 0xFFFF, 0xABCD),
        (0xABCD, 0x0000, 0x1234, 0x1234),
        (0xABCD, 0x00FF, 0x1234, 0x12CD),
        (0xABCD, 0xFF00, 0x0000, 0xAB00),
    ] {
        unit.points.words[9] = now;
        unit.request(&pdu(0x16, &[9, and, or])).expect("a reply");
        assert_eq!(unit.points.words[9], then);
    }
}

#[test]
fn a_mask_write_is_checked_like_a_write() {
    let mut unit = full();
    unit.points.read_only_from = 10;
    unit.points.words[9] = 0xFF00;
    assert_eq!(unit.refused(&pdu(0x16, &[10, 0xFFFF, 0])), 2, "read-only");
    assert_eq!(
        unit.refused(&pdu(0x16, &[9, 0xFF00, 0xFFFF])),
        3,
        "the value is out of range"
    );
    assert!(unit.request(&pdu(0x16, &[9, 0xFF00, 0xEF])).is_some());
    assert_eq!(unit.points.words[9], 0xFFEF);
    unit.points.state = Some(Exception::ServerDeviceBusy.code());
    assert_eq!(unit.refused(&pdu(0x16, &[9, 0xFFFF, 0])), 6);
    assert_eq!(
        unit.refused(&pdu(0x16, &[9, 0xFF00, 0xFFFF])),
        6,
        "a value that cannot be read cannot be masked"
    );
    assert_eq!(
        unit.refused(&pdu(0x16, &[10, 0xFFFF, 0])),
        2,
        "the address is checked first"
    );
    for len in 1..7 {
        assert_eq!(unit.refused(&pdu(0x16, &[10, 0xFFFF, 0])[..len]), 3);
    }
    assert_eq!(unit.refused(&pdu(0x16, &[9, 0, 0, 0])), 3);
    let mut small = Unit::new(Points::new(4, 4));
    assert_eq!(small.refused(&pdu(0x16, &[4, 0, 0])), 2);
}

#[test]
fn a_mask_can_be_broadcast_and_a_read_with_a_write_cannot() {
    let mut unit = full();
    unit.points.words[4] = 0x12;
    assert_eq!(unit.raw(&frame(0, &pdu(0x16, &[4, 0xF2, 0x25]))), None);
    assert_eq!(unit.points.words[4], 0x17);
    assert_eq!(unit.raw(&frame(0, &write_then_read(0, 1, 4, &[9]))), None);
    assert_eq!(
        unit.points.words[4], 0x17,
        "a broadcast with a read has no effect"
    );
    assert_eq!(unit.raw(&frame(UNIT + 1, &pdu(0x16, &[4, 0, 0]))), None);
    assert_eq!(unit.points.words[4], 0x17);
}

#[test]
fn the_standards_example_of_a_read_with_a_write_returns_its_reply() {
    let mut unit = full();
    unit.points.words[3..9].copy_from_slice(&[0x00FE, 0x0ACD, 1, 3, 0x000D, 0x00FF]);
    let reply = unit
        .request(&write_then_read(3, 6, 14, &[0xFF; 3]))
        .unwrap();
    let data = [0, 0xFE, 0x0A, 0xCD, 0, 1, 0, 3, 0, 0x0D, 0, 0xFF];
    assert_eq!(reply, [&[0x17, 0x0C][..], &data].concat());
    assert_eq!(unit.points.words[13..18], [0, 0xFF, 0xFF, 0xFF, 0]);
}

#[test]
fn the_write_is_executed_before_the_read() {
    let mut unit = full();
    let reply = unit.request(&write_then_read(9, 3, 10, &[0x1234, 0x5678]));
    assert_eq!(reply, Some(vec![0x17, 6, 0, 0, 0x12, 0x34, 0x56, 0x78]));
}

#[test]
fn up_to_125_are_read_and_up_to_121_written() {
    let mut unit = full();
    let words: Vec<u16> = (0..121).map(|n| n * 3).collect();
    let reply = unit
        .request(&write_then_read(0xFF00, 125, 0xFF04, &words))
        .unwrap();
    assert_eq!((reply.len(), reply[1]), (252, 250));
    assert_eq!(unit.points.words[0xFF04..0xFF04 + 121], words);
    assert_eq!(unit.refused(&write_then_read(0, 126, 0, &words)), 3);
    assert_eq!(unit.refused(&write_then_read(0, 0, 0, &words)), 3);
    assert_eq!(unit.refused(&write_then_read(0, 1, 0, &[])), 3);
    // A frame of 256 bytes has no room for a 122nd word. A truncated request that fits is rejected, too.
    let mut long = write_then_read(0, 1, 0, &[1; 122]);
    assert_eq!(long.len(), 254);
    long.truncate(253);
    assert_eq!(unit.refused(&long), 3);
}

#[test]
fn both_ranges_and_the_values_are_checked_before_anything_is_written() {
    let mut unit = Unit::new(Points::new(4, 20));
    unit.points.read_only_from = 10;
    assert_eq!(
        unit.refused(&write_then_read(19, 2, 0, &[1])),
        2,
        "the read is out of range"
    );
    assert_eq!(
        unit.refused(&write_then_read(0, 1, 9, &[1, 2])),
        2,
        "the write is out of range"
    );
    assert_eq!(unit.refused(&write_then_read(0xFFFF, 2, 0, &[1])), 2);
    assert_eq!(unit.refused(&write_then_read(0, 1, 0xFFFF, &[1, 2])), 2);
    let beyond = MAX_WORD + 1;
    assert_eq!(unit.refused(&write_then_read(0, 1, 9, &[beyond])), 3);
    assert_eq!(
        unit.refused(&write_then_read(20, 1, 9, &[beyond])),
        2,
        "02 is checked first"
    );
    assert_eq!(
        unit.refused(&write_then_read(0xFFFF, 2, 0, &[])),
        3,
        "03 is checked before both"
    );
    assert_eq!(
        unit.refused(&write_then_read(0xFFFF, 126, 0xFFFF, &[1, 1])),
        3
    );
    unit.points.state = Some(Exception::ServerDeviceFailure.code());
    assert_eq!(unit.refused(&write_then_read(0, 1, 9, &[beyond])), 3);
    assert_eq!(unit.refused(&write_then_read(0, 1, 9, &[1])), 4);
    assert_eq!(unit.refused(&write_then_read(20, 1, 9, &[1])), 2);
}

#[test]
fn an_incomplete_request_is_rejected() {
    let mut unit = full();
    let whole = write_then_read(0, 2, 4, &[1, 2, 3]);
    for len in 1..whole.len() {
        assert_eq!(unit.refused(&whole[..len]), 3);
    }
    assert_eq!(unit.refused(&[&whole[..], &[0]].concat()), 3);
    for count in (0..=255).filter(|count| *count != 6) {
        let mut odd = whole.clone();
        odd[9] = count;
        assert_eq!(unit.refused(&odd), 3, "byte count {count}");
    }
}
