//! Frames from the manuals of other devices, used only where their CRC is correct, and from the standard. The
//! requests must be understood, and the replies must match byte for byte.
//!
//! The frames with unit 01 are from the manual of the mightyZAP 17Lf actuator, those with unit 1F from the manual
//! of a servo drive. Two kinds of frames are left out: the drive's replies to function 03, which repeat the address
//! where the standard requires a byte count, and the actuator's `01 86 04 40 F3`, whose CRC is that of `01 83 04`
//! (correct: `43 A3`).

mod common;

use common::{Points, Unit, frame};
use modbus_server::Exception;

/// Returns bytes from hexadecimal digits.
fn hex(text: &str) -> Vec<u8> {
    let digits: Vec<u32> = text.chars().filter_map(|c| c.to_digit(16)).collect();
    digits
        .chunks(2)
        .map(|pair| (pair[0] << 4 | pair[1]) as u8)
        .collect()
}

/// Returns a unit at `address` with a point at every address.
fn unit(address: u8) -> Unit {
    Unit::with(address, false, Points::new(0x1_0000, 0x1_0000))
}

fn exchange(unit: &mut Unit, request: &str, reply: &str) {
    assert_eq!(unit.raw(&hex(request)), Some(hex(reply)), "{request}");
}

#[test]
fn reads_of_an_actuator_match_its_manual() {
    let mut unit = unit(1);
    unit.points.words[0xD2] = 1000;
    unit.points.words[0xD3] = 426;
    exchange(&mut unit, "01 03 00 D2 00 01 24 33", "01 03 02 03 E8 B8 FA");
    exchange(&mut unit, "01 03 00 D3 00 01 75 F3", "01 03 02 01 AA 39 AB");
}

#[test]
fn failures_of_an_actuator_match_its_manual() {
    let mut unit = unit(1);
    unit.points.state = Some(Exception::ServerDeviceFailure.code());
    exchange(&mut unit, "01 03 00 D3 00 01 75 F3", "01 83 04 40 F3");
    exchange(&mut unit, "01 06 00 CD 03 E8 18 8B", "01 86 04 43 A3");
}

#[test]
fn writes_to_an_actuator_match_its_manual() {
    let mut unit = unit(1);
    exchange(
        &mut unit,
        "01 06 00 CD 03 E8 18 8B",
        "01 06 00 CD 03 E8 18 8B",
    );
    exchange(
        &mut unit,
        "01 06 00 D1 03 20 D8 DB",
        "01 06 00 D1 03 20 D8 DB",
    );
    assert_eq!(
        (unit.points.words[0xCD], unit.points.words[0xD1]),
        (1000, 800)
    );
    exchange(
        &mut unit,
        "01 10 00 D0 00 02 04 03 E8 03 20 7F AB",
        "01 10 00 D0 00 02 40 31",
    );
    assert_eq!(unit.points.words[0xD0..0xD2], [1000, 800]);
}

#[test]
fn writes_to_a_servo_drive_match_its_manual() {
    let mut unit = unit(0x1F);
    exchange(
        &mut unit,
        "1F 06 00 06 13 88 67 23",
        "1F 06 00 06 13 88 67 23",
    );
    // The drive's own reply to this request is not standard; the reply here is.
    let read = unit.raw(&hex("1F 03 00 06 00 01 67 B5"));
    assert_eq!(read, Some(frame(0x1F, &hex("03 02 13 88"))));
    exchange(
        &mut unit,
        "1F 10 00 06 00 02 04 13 88 00 01 56 C3",
        "1F 10 00 06 00 02 A2 77",
    );
    assert_eq!(unit.points.words[6..8], [5000, 1]);
    for (request, word) in [
        ("1F 10 20 00 00 02 04 00 1E 10 88 67 E6", 0x001E),
        ("1F 10 20 00 00 02 04 00 12 10 88 A7 E5", 0x0012),
        ("1F 10 20 00 00 02 04 00 2E 10 88 67 E9", 0x002E),
    ] {
        exchange(&mut unit, request, "1F 10 20 00 00 02 49 B6");
        assert_eq!(unit.points.words[0x2000..0x2002], [word, 0x1088]);
    }
    exchange(
        &mut unit,
        "1F 06 20 00 00 01 40 74",
        "1F 06 20 00 00 01 40 74",
    );
    assert_eq!(unit.points.words[0x2000..0x2002], [1, 0x1088]);
}

#[test]
fn a_read_of_no_words_is_rejected_as_the_standard_requires() {
    let mut unit = unit(0x1F);
    for request in ["1F 03 0D 00 00 00 44 D8", "1F 03 0E 01 00 00 15 5C"] {
        assert_eq!(unit.raw(&hex(request)), Some(frame(0x1F, &hex("83 03"))));
    }
}

#[test]
fn the_examples_of_the_standard_match() {
    // V1.1b3 6.1 to 6.12. The standard lists PDUs; the CRC is added here.
    let mut unit = Unit::new(Points::new(0x1_0000, 0x1_0000));
    let mut pdus = |request: &str, reply: &str, prepare: &dyn Fn(&mut Points)| {
        prepare(&mut unit.points);
        assert_eq!(unit.request(&hex(request)), Some(hex(reply)), "{request}");
    };
    let bits = |table: &mut [bool], start: usize, bytes: &[u8]| {
        for (index, bit) in table[start..][..bytes.len() * 8].iter_mut().enumerate() {
            *bit = bytes[index / 8] >> (index % 8) & 1 != 0;
        }
    };
    pdus("01 0013 0013", "01 03 CD 6B 05", &|points| {
        bits(&mut points.bits, 0x13, &[0xCD, 0x6B, 0x05]);
    });
    pdus("02 00C4 0016", "02 03 AC DB 35", &|points| {
        bits(&mut points.input_bits, 0xC4, &[0xAC, 0xDB, 0x35]);
    });
    pdus("03 006B 0003", "03 06 022B 0000 0064", &|points| {
        points.words[0x6B..0x6E].copy_from_slice(&[0x022B, 0, 0x64]);
    });
    pdus("04 0008 0001", "04 02 000A", &|points| {
        points.input_words[8] = 10;
    });
    pdus("05 00AC FF00", "05 00AC FF00", &|_| ());
    pdus("06 0001 0003", "06 0001 0003", &|_| ());
    pdus("0F 0013 000A 02 CD01", "0F 0013 000A", &|_| ());
    pdus("10 0001 0002 04 000A 0102", "10 0001 0002", &|_| ());
    assert!(unit.points.bits[0xAC]);
    assert_eq!(unit.points.words[1..3], [0x000A, 0x0102]);
}
