//! The effect and the limits of each function (V1.1b3 section 6).

mod common;

use common::{MAX_WORD, Points, UNIT, Unit, pack, pdu, write_bits, write_words};
use modbus_server::line::{Framing, Receiver};
use modbus_server::{BitsOut, DataModel, Exception, Span, Table, WordsOut};

/// Returns a unit with a point at every address.
fn full() -> Unit {
    Unit::new(Points::new(0x1_0000, 0x1_0000))
}

#[test]
fn bits_are_packed_from_bit_0_and_the_padding_is_zero() {
    for function in [0x01, 0x02] {
        let mut unit = full();
        unit.points.bits_of(function)[20..31].copy_from_slice(&[
            true, false, true, true, false, false, true, true, true, true, false,
        ]);
        unit.points.bits_of(function)[31] = true; // not requested: must not be in the padding
        let reply = unit.request(&pdu(function, &[20, 11])).unwrap();
        assert_eq!(reply, [function, 2, 0b1100_1101, 0b0000_0011]);
    }
}

#[test]
fn up_to_2000_bits_are_read_in_one_request() {
    for function in [0x01, 0x02] {
        let mut unit = full();
        unit.points
            .bits_of(function)
            .iter_mut()
            .skip(1)
            .step_by(3)
            .for_each(|bit| *bit = true);
        let reply = unit.request(&pdu(function, &[0, 2000])).unwrap();
        assert_eq!(reply[..2], [function, 250]);
        assert_eq!(reply[2..], pack(&unit.points.bits_of(function)[..2000]));
        assert_eq!(unit.refused(&pdu(function, &[0, 2001])), 3);
        assert_eq!(unit.refused(&pdu(function, &[0, 0xFFFF])), 3);
        assert_eq!(unit.refused(&pdu(function, &[0, 0])), 3);
    }
}

#[test]
fn words_are_sent_high_byte_first() {
    for function in [0x03, 0x04] {
        let mut unit = full();
        unit.points.words_of(function)[0x1234] = 0xABCD;
        unit.points.words_of(function)[0x1235] = 0x0102;
        let reply = unit.request(&pdu(function, &[0x1234, 2])).unwrap();
        assert_eq!(reply, [function, 4, 0xAB, 0xCD, 0x01, 0x02]);
    }
}

#[test]
fn up_to_125_words_are_read_in_one_request() {
    for function in [0x03, 0x04] {
        let mut unit = full();
        (0..125).for_each(|n| unit.points.words_of(function)[n] = (n * 0x0203) as u16);
        let reply = unit.request(&pdu(function, &[0, 125])).unwrap();
        assert_eq!(reply[..2], [function, 250]);
        let bytes = unit.points.words_of(function)[..125]
            .iter()
            .flat_map(|word| word.to_be_bytes());
        assert!(reply[2..].iter().copied().eq(bytes));
        assert_eq!(unit.refused(&pdu(function, &[0, 126])), 3);
        assert_eq!(unit.refused(&pdu(function, &[0, 0xFFFF])), 3);
        assert_eq!(unit.refused(&pdu(function, &[0, 0])), 3);
    }
}

#[test]
fn the_last_address_can_be_used_and_nothing_wraps() {
    let mut unit = full();
    for function in 0x01..=0x04 {
        assert!(unit.request(&pdu(function, &[0xFFFF, 1])).unwrap()[0] == function);
        assert_eq!(unit.refused(&pdu(function, &[0xFFFF, 2])), 2);
    }
    assert_eq!(
        unit.request(&pdu(0x05, &[0xFFFF, 0xFF00])).unwrap()[0],
        0x05
    );
    assert_eq!(unit.request(&pdu(0x06, &[0xFFFF, 7])).unwrap()[0], 0x06);
    assert_eq!(
        (unit.points.bits[0xFFFF], unit.points.words[0xFFFF]),
        (true, 7)
    );
    assert_eq!(
        unit.request(&write_bits(0xFFFF, &[false])).unwrap()[0],
        0x0F
    );
    assert_eq!(unit.request(&write_words(0xFFFF, &[8])).unwrap()[0], 0x10);
    assert_eq!(
        (unit.points.bits[0xFFFF], unit.points.words[0xFFFF]),
        (false, 8)
    );
    assert_eq!(unit.refused(&write_bits(0xFFFF, &[true, true])), 2);
    assert_eq!(unit.refused(&write_words(0xFFFF, &[1, 1])), 2);
}

#[test]
fn a_single_bit_accepts_only_ff00_and_0000() {
    let mut unit = full();
    let on = pdu(0x05, &[172, 0xFF00]);
    assert_eq!(unit.request(&on).unwrap(), on);
    assert!(unit.points.bits[172]);
    for value in [0x0001, 0x1234, 0xFF01, 0x00FF, 0xFFFF, 0x0100] {
        assert_eq!(unit.refused(&pdu(0x05, &[172, value])), 3, "{value:04X}");
    }
    let off = pdu(0x05, &[172, 0x0000]);
    assert_eq!(unit.request(&off).unwrap(), off);
    assert!(!unit.points.bits[172]);
    assert!(
        unit.points.bits.iter().all(|bit| !bit),
        "no other bit changes"
    );
}

#[test]
fn a_single_word_is_written_and_echoed() {
    let mut unit = full();
    let write = pdu(0x06, &[1, 0x1234]);
    assert_eq!(unit.request(&write).unwrap(), write);
    assert_eq!(unit.points.words[..3], [0, 0x1234, 0]);
    assert_eq!(unit.refused(&pdu(0x06, &[1, MAX_WORD + 1])), 3);
}

#[test]
fn multiple_bits_are_written_and_padding_is_ignored() {
    let mut unit = full();
    unit.points.bits[29] = true;
    // The standard's own example (6.11): ten bits from 19 on, here with the padding set.
    let reply = unit
        .request(&[0x0F, 0x00, 0x13, 0x00, 0x0A, 0x02, 0xCD, 0xFD])
        .unwrap();
    assert_eq!(reply, [0x0F, 0x00, 0x13, 0x00, 0x0A]);
    assert_eq!(
        unit.points.bits[18..31],
        [0, 1, 0, 1, 1, 0, 0, 1, 1, 1, 0, 1, 0].map(|bit| bit == 1)
    );
}

#[test]
fn up_to_1968_bits_are_written_in_one_request() {
    let mut unit = full();
    let bits: Vec<bool> = (0..1968).map(|n| n % 7 < 3).collect();
    let request = write_bits(5, &bits);
    assert_eq!(request.len(), 252, "a frame of 255 bytes");
    assert_eq!(unit.request(&request).unwrap(), pdu(0x0F, &[5, 1968]));
    assert_eq!(unit.points.bits[5..5 + 1968], bits);
    assert_eq!(unit.refused(&write_bits(5, &[true; 1969])), 3);
    assert_eq!(unit.refused(&write_bits(5, &[])), 3);
}

#[test]
fn up_to_123_words_are_written_in_one_request() {
    let mut unit = full();
    let words: Vec<u16> = (0..123).map(|n| n * 0x0101).collect();
    let request = write_words(0xFF00, &words);
    assert_eq!(request.len(), 252, "a frame of 255 bytes");
    assert_eq!(unit.request(&request).unwrap(), pdu(0x10, &[0xFF00, 123]));
    assert_eq!(unit.points.words[0xFF00..0xFF00 + 123], words);
    assert_eq!(unit.refused(&write_words(5, &[])), 3);
}

#[test]
fn a_124th_word_is_rejected() {
    // Complete, it would need a frame of 257 bytes. A truncated request that fits a frame is rejected, too.
    let mut unit = full();
    let mut request = write_words(0, &[1; 124]);
    assert_eq!(request[5], 248);
    request.truncate(253);
    assert_eq!(unit.refused(&request), 3);
    request.truncate(6);
    assert_eq!(unit.refused(&request), 3);
}

#[test]
fn a_byte_count_must_match_the_quantity() {
    let mut unit = full();
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
            let mut request = pdu(function, &[0, quantity]);
            request.push(count);
            request.extend(vec![0x55; data]);
            assert_eq!(unit.refused(&request), 3, "{function:02X} {count} {data}");
        }
    }
}

#[test]
fn a_pdu_one_byte_too_short_or_long_is_rejected() {
    let mut unit = full();
    let requests = [
        pdu(0x01, &[0, 8]),
        pdu(0x02, &[0, 8]),
        pdu(0x03, &[0, 1]),
        pdu(0x04, &[0, 1]),
        pdu(0x05, &[0, 0xFF00]),
        pdu(0x06, &[0, 1]),
        write_bits(0, &[true; 9]),
        write_words(0, &[1, 2]),
    ];
    for request in requests {
        // Every shorter PDU, down to only the function code.
        for len in 1..request.len() {
            assert_eq!(unit.refused(&request[..len]), 3, "{:02X?}", &request[..len]);
        }
        for extra in [0x00, 0xFF] {
            let long = [request.as_slice(), &[extra]].concat();
            assert_eq!(unit.refused(&long), 3, "{long:02X?}");
        }
        assert_eq!(unit.request(&request).unwrap()[0], request[0]);
    }
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
