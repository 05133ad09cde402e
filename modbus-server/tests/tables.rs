//! Four tables, and models with only some tables or functions (V1.1b3 4.3, 4.4).

mod common;

use common::{
    Points, Unit, frame, pdu, read_files, write_bits, write_files, write_then_read, write_words,
};
use modbus_server::line::{Framing, Receiver};
use modbus_server::{DataModel, Exception, Function, Span, Table, Words, WordsOut};

/// Every function code that the server supports.
const FUNCTIONS: [u8; 18] = [
    1, 2, 3, 4, 5, 6, 7, 8, 0x0B, 0x0C, 0x0F, 0x10, 0x11, 0x14, 0x15, 0x16, 0x17, 0x2B,
];

/// Returns a valid request of this function.
fn good(function: u8) -> Vec<u8> {
    match function {
        0x05 => pdu(0x05, &[0, 0xFF00]),
        0x07 | 0x0B | 0x0C | 0x11 => vec![function],
        0x0F => write_bits(0, &[true]),
        0x10 => write_words(0, &[1]),
        0x14 => read_files(&[(1, 0, 1)]),
        0x15 => write_files(&[(1, 0, vec![1])]),
        0x16 => pdu(0x16, &[0, 0, 0]),
        0x17 => write_then_read(0, 1, 0, &[1]),
        0x2B => vec![0x2B, 0x0E, 1, 0],
        // For 08 this is an echo.
        _ => pdu(function, &[0, 1]),
    }
}

#[test]
fn each_function_uses_its_table() {
    let mut points = Points::new(1, 1);
    points.input_bits = vec![true, true];
    points.words = vec![0x0303; 3];
    points.input_words = vec![0x0404; 4];
    let mut unit = Unit::new(points);
    for (function, len, data) in [
        (0x01, 1, &[0][..]),
        (0x02, 2, &[1]),
        (0x03, 3, &[3, 3]),
        (0x04, 4, &[4, 4]),
    ] {
        let reply = unit.request(&pdu(function, &[len - 1, 1])).unwrap();
        assert_eq!(reply[2..], *data, "{function:02X}");
        assert_eq!(unit.refused(&pdu(function, &[len, 1])), 2, "{function:02X}");
    }
    assert_eq!(unit.refused(&write_bits(1, &[false])), 2);
    assert_eq!(unit.refused(&write_words(3, &[1])), 2);
    assert_eq!(unit.refused(&write_then_read(3, 1, 0, &[1])), 2);
    unit.request(&write_bits(0, &[true])).unwrap();
    unit.request(&pdu(0x16, &[2, 0, 0x0505])).unwrap();
    let reply = unit.request(&write_then_read(1, 2, 1, &[0x0606])).unwrap();
    assert_eq!(reply[2..], [6, 6, 5, 5]);
    assert_eq!(unit.points.bits, [true]);
    assert_eq!(unit.points.words, [0x0303, 0x0606, 0x0505]);
    assert_eq!(unit.points.input_bits, [true, true]);
    assert_eq!(unit.points.input_words, [0x0404; 4]);
}

#[test]
fn a_function_that_the_model_does_not_have_returns_01_before_any_other_check() {
    for lacked in FUNCTIONS {
        let mut points = Points::new(1, 1);
        points.files = vec![vec![0]];
        points.lacks = vec![lacked];
        // The state of the device is checked last.
        points.state = Some(Exception::ServerDeviceBusy.code());
        let mut unit = Unit::new(points);
        for rest in [&[][..], &[0], &[0, 4, 0, 0], &[0, 1, 0, 0], &[0xFF; 252]] {
            let request = [&[lacked][..], rest].concat();
            assert_eq!(unit.refused(&request), 1, "{lacked:02X} {rest:02X?}");
        }
        assert_eq!(unit.refused(&good(lacked)), 1, "{lacked:02X}");
        unit.points.state = None;
        for other in FUNCTIONS.into_iter().filter(|other| *other != lacked) {
            let reply = unit.request(&good(other)).expect("a reply");
            assert_eq!(reply[0], other, "without {lacked:02X}");
        }
        let before = unit.points.clone();
        assert_eq!(unit.raw(&frame(0, &good(lacked))), None);
        assert_eq!(unit.points, before, "{lacked:02X} as a broadcast");
    }
}

#[test]
fn tables_that_a_model_does_not_implement_are_empty() {
    /// A model with one register to read, as holding and as input register.
    struct Register;
    impl DataModel for Register {
        fn check_read_words(&self, _: Table, span: Span) -> Result<(), Exception> {
            if span == Span::single(0) {
                Ok(())
            } else {
                Err(Exception::IllegalDataAddress)
            }
        }
        fn read_words(&self, _: Table, _: Span, out: &mut WordsOut<'_>) {
            out.push(0x1234);
        }
    }
    /// A model with nothing.
    struct Nothing;
    impl DataModel for Nothing {}

    let receiver = || Receiver::rtu(common::UNIT, false);
    let mut register = Unit::over(receiver(), Framing::Rtu, Register);
    let mut nothing = Unit::over(receiver(), Framing::Rtu, Nothing);
    let refused = |function: u8, code| Some(vec![function | 0x80, code]);
    for function in [3, 4] {
        let reply = register.request(&good(function));
        assert_eq!(reply, Some(vec![function, 2, 0x12, 0x34]));
    }
    for function in [1, 2, 5, 6, 0x0F, 0x10, 0x16, 0x17] {
        let reply = register.request(&good(function));
        assert_eq!(reply, refused(function, 2), "one register");
        let reply = nothing.request(&good(function));
        assert_eq!(reply, refused(function, 2), "nothing");
    }
    for function in [0x14, 0x15] {
        let reply = nothing.request(&good(function));
        assert_eq!(reply, refused(function, 1), "no files");
    }
    assert!(Nothing.has(Function::ReadCoils));
    let mut nothing = Nothing;
    nothing.write_words(Span::single(0), Words::new(&[0, 1]));
}

#[test]
fn a_function_of_the_model_is_served_and_its_reply_is_cut_at_252_bytes() {
    let mut unit = Unit::new(Points::new(1, 1));
    unit.points.custom = Some(0x41);
    let reply = unit.request(&[0x41, 1, 2]);
    assert_eq!(reply, Some(vec![0x41, 2, 1, 2, 1, 2, 1]));
    assert_eq!(unit.points.kept, [1, 2]);
    assert_eq!(unit.refused(&[0x41]), 3);
    assert_eq!(unit.refused(&[0x42, 1]), 1);
    assert_eq!(
        unit.request(&[0x41; 253]).map(|reply| reply.len()),
        Some(253)
    );
    unit.raw(&frame(0, &[0x41, 9]));
    assert_eq!(unit.points.kept, [0x41; 252], "a broadcast is not served");
    unit.must_answer();
}
