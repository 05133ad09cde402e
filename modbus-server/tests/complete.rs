//! Frames that are complete by their length and their CRC, for lines with pauses inside frames.

mod common;

use common::{UNIT, frame, pdu, port, read_files, write_bits, write_files, write_then_read};
use modbus_server::line::{Faults, Framing, Port, Receiver, Width};
use modbus_server::{Adu, Server, Tables};

const OTHER: u8 = UNIT + 1;

fn rtu() -> Port<'static> {
    let mut port = port(Receiver::rtu(UNIT, false));
    port.long_silence(0);
    port
}

/// Returns the lengths at which the frame of these bytes is complete.
fn complete_at(bytes: &[u8]) -> Vec<usize> {
    let mut port = rtu();
    let mut complete = |byte: &u8| {
        port.received(*byte, Faults::NONE);
        port.is_complete()
    };
    let lengths = bytes.iter().zip(1..).filter(|(byte, _)| complete(byte));
    lengths.map(|(_, length)| length).collect()
}

/// A request of every function whose length is known.
fn requests() -> Vec<Vec<u8>> {
    let reads = [1, 2, 3, 4].map(|function| pdu(function, &[0x0107, 9]));
    let alone = [0x07, 0x0B, 0x0C, 0x11].map(|function| vec![function]);
    let mut requests = vec![
        pdu(0x05, &[7, 0xFF00]),
        pdu(0x06, &[7, 0x1234]),
        pdu(0x08, &[0, 0xA537]),
        write_bits(7, &[true; 19]),
        common::write_words(7, &[1]),
        common::write_words(7, &[0x1234; 123]),
        read_files(&[(1, 0, 2)]),
        read_files(&[(1, 0, 2), (2, 5, 1)]),
        write_files(&[(1, 0, vec![7, 8])]),
        pdu(0x16, &[7, 0xF2, 0x25]),
        write_then_read(3, 6, 14, &[0xFF; 3]),
        pdu(0x18, &[0x04DE]),
        vec![0x2B, 0x0E, 1, 0],
    ];
    requests.extend(reads);
    requests.extend(alone);
    requests
}

/// A reply of every function whose length is known, and exceptions.
fn replies() -> Vec<Vec<u8>> {
    let counted = |function: u8, bytes: u8| {
        let data = (0..bytes).map(|n| n.wrapping_mul(7));
        [function, bytes].into_iter().chain(data).collect()
    };
    let mut replies = vec![
        vec![0x07, 0x6D],
        pdu(0x0B, &[0xFFFF, 0x0108]),
        counted(0x0C, 8),
        counted(0x0C, 70),
        pdu(0x0F, &[7, 19]),
        pdu(0x10, &[7, 123]),
        counted(0x11, 12),
        vec![0x14, 6, 5, 6, 0x0D, 0xFE, 0, 0x20],
        pdu(0x18, &[6, 2, 0x01B8, 0x1284]),
        vec![0x2B, 0x0E, 1, 1, 0, 0, 1, 0, 3, b'a', b'b', b'c'],
        vec![0x2B, 0x0E, 1, 1, 0, 0, 2, 0, 1, b'a', 1, 2, b'b', b'c'],
        vec![0x83, 2],
        vec![0xAB, 1],
        vec![0xC1, 1],
    ];
    for function in [0x01, 0x02, 0x03, 0x04, 0x17] {
        replies.extend([1, 2, 3, 4, 53, 250].map(|bytes| counted(function, bytes)));
    }
    replies
}

#[test]
fn request_of_every_function_is_complete_at_its_end() {
    for pdu in requests() {
        for unit in [UNIT, OTHER, 0] {
            let bytes = frame(unit, &pdu);
            assert_eq!(complete_at(&bytes), [bytes.len()], "{bytes:02X?}");
        }
    }
}

#[test]
fn reply_of_another_unit_is_complete_at_its_end() {
    // The replies of the other functions look like their requests.
    for pdu in requests().into_iter().chain(replies()) {
        let bytes = frame(OTHER, &pdu);
        assert_eq!(complete_at(&bytes), [bytes.len()], "{bytes:02X?}");
    }
}

/// Nobody else sends a reply with this unit's address, and a broadcast has none.
#[test]
fn reply_with_the_address_of_this_unit_or_of_a_broadcast_is_not_complete() {
    for reply in [
        &[0x03, 2, 0, 5][..],
        &[0x11, 1, 0xFF],
        &[0x07, 0],
        &[0x83, 2],
    ] {
        for unit in [UNIT, 0] {
            let bytes = frame(unit, reply);
            assert_eq!(complete_at(&bytes), [0; 0], "{bytes:02X?}");
        }
    }
}

#[test]
fn complete_request_is_served_without_a_silence() {
    let mut registers = [0x1111; 10];
    let mut tables = Tables {
        holding_registers: &mut registers,
        ..Tables::default()
    };
    let mut port = rtu();
    let mut server = Server::new(Framing::Rtu);
    for reply in [None, Some(UNIT), None] {
        let unit = reply.unwrap_or(OTHER);
        for byte in frame(unit, &pdu(0x03, &[0, 1])) {
            assert!(!port.is_complete());
            port.received(byte, Faults::NONE);
        }
        assert!(port.is_complete());
        assert_eq!(port.long_silence(0), reply.is_some());
        assert!(!port.is_complete());
        let request = port.take();
        assert_eq!(request.is_some(), reply.is_some());
        if let Some(request) = request {
            port.send(server.serve(request, &mut tables), 0);
        }
        assert_eq!(port.start(), reply);
        port.sent();
    }
    assert_eq!(port.counters().bus_messages, 3);
}

#[test]
fn function_08_with_more_data_and_functions_of_unknown_length_are_never_complete() {
    for pdu in [
        pdu(0x08, &[0, 1, 2]),
        [&[0x08, 0, 0][..], &[0x55; 100]].concat(),
        vec![0x08],
        vec![0x00],
        vec![0x09],
        vec![0x13, 1, 2],
        vec![0x41, 0, 1, 0, 1],
        vec![0x2B, 0x0D, 1, 0],
        vec![0x7F; 100],
    ] {
        for unit in [UNIT, OTHER, 0] {
            let bytes = frame(unit, &pdu);
            assert_eq!(complete_at(&bytes), [0; 0], "{bytes:02X?}");
        }
    }
}

#[test]
fn frame_after_noise_is_not_complete() {
    for pdu in requests().into_iter().chain(replies()) {
        for noise in [&[0x00][..], &[0xFF], &[0x55, 0xAA], &[OTHER, 3, 2]] {
            let bytes = [noise, &frame(OTHER, &pdu)].concat();
            assert_eq!(complete_at(&bytes), [0; 0], "{bytes:02X?}");
        }
    }
}

#[test]
fn frame_with_a_bit_error_is_not_complete() {
    for pdu in requests().into_iter().chain(replies()) {
        let bytes = frame(OTHER, &pdu);
        for bit in 0..bytes.len() * 8 {
            let mut bad = bytes.clone();
            bad[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(complete_at(&bad), [0; 0], "{bad:02X?}");
        }
    }
}

#[test]
fn request_with_a_byte_count_that_does_not_fit_is_not_complete() {
    let mut short = common::write_words(7, &[1, 2]);
    short.pop();
    let long = [&short[..], &[1, 2]].concat();
    for pdu in [short, long] {
        assert_eq!(complete_at(&frame(UNIT, &pdu)), [0; 0], "{pdu:02X?}");
    }
}

/// The CRC is valid one byte before the end, and the frame has the length of a reply with one word there.
#[test]
fn request_whose_crc_ends_in_0_is_complete_at_its_end() {
    let ends_in_0 = |bytes: &Vec<u8>| bytes.ends_with(&[0]);
    let mut requests = (0x0200..0x0300).map(|address| frame(UNIT, &pdu(0x03, &[address, 1])));
    let bytes = requests.find(ends_in_0).expect("one in 256");
    assert_eq!(complete_at(&bytes), [8]);
    let mut requests = (0x0200..0x0300).map(|address| frame(OTHER, &pdu(0x03, &[address, 1])));
    let bytes = requests.find(ends_in_0).expect("one in 256");
    assert_eq!(complete_at(&bytes), [7, 8]);
}

/// The first five bytes have a valid CRC, and the form of a reply without data.
#[test]
fn beginning_of_a_request_is_no_reply_without_data() {
    let bytes = frame(3, &pdu(0x04, &[131, 1]));
    assert_eq!(common::crc(&bytes[..3]), bytes[3..5]);
    assert_eq!(complete_at(&bytes), [8]);
}

#[test]
fn damaged_frame_and_frame_without_a_start_or_a_buffer_are_not_complete() {
    let bytes = frame(UNIT, &pdu(0x03, &[0, 1]));
    let complete = |port: &mut Port<'_>, faults| {
        let mut each = bytes.iter().zip(0..);
        each.any(|(byte, at)| {
            port.received(*byte, if at == 4 { faults } else { Faults::NONE });
            port.is_complete()
        })
    };
    assert!(complete(&mut rtu(), Faults::NONE));
    assert!(!complete(&mut rtu(), Faults::FRAMING));
    let mut deaf = port(Receiver::rtu(UNIT, false));
    assert!(!complete(&mut deaf, Faults::NONE));
    let mut ascii = port(Receiver::ascii(UNIT, Width::Eight));
    assert!(!complete(&mut ascii, Faults::NONE));
    let mut adus = [Adu::new()];
    let mut single = Port::new(Receiver::rtu(UNIT, false), &mut adus);
    single.long_silence(0);
    assert!(complete(&mut single, Faults::NONE) && single.long_silence(0));
    assert!(!complete(&mut single, Faults::NONE), "no buffer is free");
}
