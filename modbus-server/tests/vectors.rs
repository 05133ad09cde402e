//! The examples of the standard, V1.1b3 6.1 to 6.12. Worked frames of manuals are cases of the conformance suite.

mod common;

use common::{Points, Unit};

/// Returns bytes from hexadecimal digits.
fn hex(text: &str) -> Vec<u8> {
    let digits: Vec<u32> = text.chars().filter_map(|c| c.to_digit(16)).collect();
    digits
        .chunks(2)
        .map(|pair| (pair[0] << 4 | pair[1]) as u8)
        .collect()
}

#[test]
fn the_examples_of_the_standard_match() {
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
