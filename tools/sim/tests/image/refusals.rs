//! Refused requests: their exception code, and that they change nothing.

use sim::{Channel, Module};

use crate::bench::{Bench, FIRST};

fn exception(bench: &mut Bench, pdu: &[u8]) -> u8 {
    let reply = bench.ask(1, pdu);
    match reply.as_deref() {
        Some(&[function, code]) if function == pdu[0] | 0x80 => code,
        _ => panic!("{pdu:02X?} was answered by {reply:02X?}"),
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn first_failed_check_decides_the_exception_code() {
    let mut bench = Bench::new(Module::Do4, 1);
    let cases: &[(&[u8], u8)] = &[
        // 01: unknown function.
        (&[0x41], 1),
        (&[0x09], 1),
        (&[0x7F, 0, 0, 0, 0], 1),
        // 03: the quantity, which is checked before the address.
        (&[0x01, 0, FIRST, 0, 0], 3),
        (&[0x01, 0, FIRST, 0x07, 0xD1], 3),
        (&[0x02, 0xFF, 0xFF, 0, 0], 3),
        (&[0x03, 0, FIRST, 0, 0], 3),
        (&[0x03, 0, FIRST, 0, 126], 3),
        (&[0x04, 0xFF, 0xFF, 0, 126], 3),
        (&[0x0F, 0, FIRST, 0, 0, 0], 3),
        (&[0x10, 0, FIRST, 0, 0, 0], 3),
        (&[0x10, 0, FIRST, 0, 124, 248], 3),
        // 03: byte count.
        (&[0x0F, 0, FIRST, 0, 4, 2, 0x0F, 0], 3),
        (&[0x0F, 0, FIRST, 0, 4, 0], 3),
        (&[0x10, 0, FIRST, 0, 1, 3, 0, 0, 0], 3),
        (&[0x10, 0, FIRST, 0, 2, 2, 0, 0], 3),
        (&[0x10, 0, FIRST, 0, 1, 255, 0, 1], 3),
        // 03: an invalid coil value, which is checked before the address.
        (&[0x05, 0, FIRST, 0x00, 0x01], 3),
        (&[0x05, 0, FIRST, 0x12, 0x34], 3),
        (&[0x05, 0, FIRST, 0xFF, 0x01], 3),
        (&[0x05, 0x7F, 0x10, 0x12, 0x34], 3),
        // 03: requests that are too short or too long.
        (&[0x01, 0, FIRST, 0], 3),
        (&[0x01, 0, FIRST, 0, 4, 0], 3),
        (&[0x05, 0, FIRST, 0xFF], 3),
        (&[0x0F, 0, FIRST, 0, 4, 1, 0x0F, 0], 3),
        (&[0x06, 0, FIRST, 0], 3),
        // 02: addresses without a point.
        (&[0x01, 0, 0x0F, 0, 1], 2),
        (&[0x01, 0, 0x14, 0, 1], 2),
        (&[0x01, 0, FIRST, 0, 5], 2),
        (&[0x01, 0, FIRST, 0x07, 0xD0], 2),
        (&[0x01, 0xFF, 0xFF, 0, 2], 2),
        (&[0x02, 0xFF, 0xFF, 0, 1], 2),
        (&[0x03, 0, FIRST, 0, 1], 2),
        (&[0x04, 0xFF, 0xFF, 0, 2], 2),
        (&[0x05, 0, 0x14, 0xFF, 0], 2),
        (&[0x06, 0, FIRST, 0, 1], 2),
        (&[0x0F, 0, FIRST + 3, 0, 2, 1, 3], 2),
        (&[0x10, 0, FIRST, 0, 1, 2, 0, 1], 2),
    ];
    for (pdu, code) in cases {
        assert_eq!(exception(&mut bench, pdu), *code, "{pdu:02X?}");
    }
    for channel in 1..=4 {
        assert_eq!(bench.board.channel(channel), Channel::Do { on: false });
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn inputs_cannot_be_written() {
    let mut bench = Bench::new(Module::Di4, 1);
    for pdu in [
        &[0x05, 0, FIRST, 0xFF, 0][..],
        &[0x0F, 0, FIRST, 0, 4, 1, 0x0F],
        &[0x06, 0, FIRST, 0, 1],
        &[0x10, 0, FIRST, 0, 1, 2, 0, 1],
    ] {
        assert_eq!(exception(&mut bench, pdu), 2, "{pdu:02X?}");
    }
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn the_largest_requests_are_accepted() {
    let mut bench = Bench::new(Module::Do4, 1);
    // 1968 coils: 255 bytes on the line, refused only because of the address.
    let coils = [&[0x0F, 0, FIRST, 0x07, 0xB0, 246][..], &[0xFF; 246]].concat();
    assert_eq!(exception(&mut bench, &coils), 2);
    let registers = [&[0x10, 0, FIRST, 0, 123, 246][..], &[0; 246]].concat();
    assert_eq!(exception(&mut bench, &registers), 2);
    // 1969 coils are one too many.
    let coils = [&[0x0F, 0, FIRST, 0x07, 0xB1, 247][..], &[0xFF; 247]].concat();
    assert_eq!(exception(&mut bench, &coils), 3);
}

#[test]
#[ignore = "needs the image: cargo xtask test"]
fn invalid_function_code_gets_no_reply() {
    let mut bench = Bench::new(Module::Do4, 1);
    for function in [0x00, 0x80, 0x81, 0x8F, 0xFF] {
        assert_eq!(
            bench.ask(1, &[function, 0, FIRST, 0, 4]),
            None,
            "{function:02X}"
        );
    }
    bench.assert_answers(1);
}
