//! A frame as a sentence: the form of the simulator's log.
//!
//! The functions that read and write points (01 to 06, 0F and 10) have their own sentences. For the other functions the
//! sentence is that of [`decode`].

use crate::adu::{Framing, RTU_MOST};
use crate::{Direction, decode, names};

/// Returns what a frame on a serial line says. The frame's own form shows whether it is RTU or ASCII.
#[must_use]
pub fn frame(direction: Direction, bytes: &[u8]) -> String {
    let opened = Framing::on_line(bytes).and_then(|framing| framing.open(bytes));
    let Some((unit, pdu)) = opened else {
        return damaged(bytes);
    };
    let to = match (direction, unit) {
        (Direction::Request, 0) => "all units".to_owned(),
        _ => format!("unit {unit}"),
    };
    let what = match (direction, pdu[0]) {
        (_, 0x80..) => exception(&pdu),
        (Direction::Request, _) => asked(&pdu),
        (Direction::Response, _) => answered(&pdu),
    };
    format!("{to}: {what}")
}

/// Returns what is wrong with bytes that are not a frame.
fn damaged(bytes: &[u8]) -> String {
    let length = bytes.len();
    match bytes {
        [b':', .., b'\r', b'\n'] => format!("{length} bytes with a bad LRC"),
        _ if length < 4 => format!("{length} bytes, too short for a frame"),
        _ if length > RTU_MOST => format!("{length} bytes, too long for a frame"),
        _ => format!("{length} bytes with a bad CRC"),
    }
}

fn asked(pdu: &[u8]) -> String {
    let Some((verb, noun)) = points(pdu[0]) else {
        return decode::request(pdu);
    };
    written(pdu)
        .or_else(|| read(pdu))
        .unwrap_or_else(|| format!("{verb} {noun}: {} bytes", pdu.len() - 1))
}

fn answered(pdu: &[u8]) -> String {
    let Some((_, noun)) = points(pdu[0]) else {
        return decode::response(pdu, None);
    };
    if let Some(text) = written(pdu) {
        return format!("{text}, done");
    }
    let bytes = pdu.iter().skip(2).map(|byte| format!("{byte:02x}"));
    format!("{noun}: {}", bytes.collect::<Vec<_>>().join(" "))
}

fn exception(pdu: &[u8]) -> String {
    let function = pdu[0] & 0x7F;
    let to = match (points(function), names::function(function)) {
        (Some((verb, noun)), _) => format!("{verb} {noun}"),
        (None, Some(name)) => name.to_owned(),
        (None, None) => format!("do function {function:02x}"),
    };
    match pdu[1..] {
        [code] => match names::exception(code) {
            Some(name) => format!("exception {code:02x}, {name}, to {to}"),
            None => format!("exception {code:02x} to {to}"),
        },
        _ => format!("a broken exception to {to}"),
    }
}

/// The verb and the noun of a function that reads or writes points.
const fn points(function: u8) -> Option<(&'static str, &'static str)> {
    Some(match function {
        0x01 => ("read", "coils"),
        0x02 => ("read", "discrete inputs"),
        0x03 => ("read", "holding registers"),
        0x04 => ("read", "input registers"),
        0x05 => ("write", "coil"),
        0x06 => ("write", "register"),
        0x0F => ("write", "coils"),
        0x10 => ("write", "registers"),
        _ => return None,
    })
}

/// The request to read points; `None` when the PDU is another one, or too short.
fn read(pdu: &[u8]) -> Option<String> {
    let (verb, noun) = points(pdu[0])?;
    let (at, count) = (decode::word(pdu, 1)?, decode::word(pdu, 3)?);
    matches!(pdu[0], 0x01..=0x04).then(|| format!("{verb} {count} {noun} from {at:#06x}"))
}

/// The request to write points, or the response, which repeats its beginning; `None` when the PDU is another one.
fn written(pdu: &[u8]) -> Option<String> {
    let (verb, noun) = points(pdu[0])?;
    let (at, value) = (decode::word(pdu, 1)?, decode::word(pdu, 3)?);
    match pdu[0] {
        0x05 | 0x06 => Some(format!("{verb} {noun} {at:#06x}: {value:#06x}")),
        0x0F | 0x10 => Some(format!("{verb} {value} {noun} from {at:#06x}")),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sentence, which RTU and ASCII frames with the same content share.
    fn told(unit: u8, pdu: &[u8], direction: Direction) -> String {
        let [rtu, ascii] = [Framing::Rtu, Framing::Ascii].map(|f| f.frame(0, unit, pdu));
        let text = frame(direction, &rtu);
        assert_eq!(frame(direction, &ascii), text);
        text
    }

    #[test]
    fn request_is_described_in_a_sentence() {
        for (unit, pdu, text) in [
            (
                1,
                &[1, 0, 0x10, 0, 4][..],
                "unit 1: read 4 coils from 0x0010",
            ),
            (
                247,
                &[4, 2, 0, 0, 2],
                "unit 247: read 2 input registers from 0x0200",
            ),
            (
                0,
                &[5, 0, 0x10, 0xFF, 0],
                "all units: write coil 0x0010: 0xff00",
            ),
            (
                1,
                &[15, 0, 0x10, 0, 4, 1, 5],
                "unit 1: write 4 coils from 0x0010",
            ),
            (
                1,
                &[0x2B, 14, 1, 0],
                "unit 1: encapsulated interface read device identification, code 01, from object 00",
            ),
            (1, &[0x11], "unit 1: report server id"),
            (1, &[0x41, 5], "unit 1: function 41: 05"),
            (1, &[3, 0], "unit 1: read holding registers: 1 bytes"),
        ] {
            assert_eq!(told(unit, pdu, Direction::Request), text);
        }
    }

    #[test]
    fn response_is_described_in_a_sentence() {
        for (pdu, text) in [
            (&[1, 1, 0x05][..], "unit 1: coils: 05"),
            (
                &[3, 4, 0x23, 0x83, 0x58, 0x60],
                "unit 1: holding registers: 23 83 58 60",
            ),
            (
                &[5, 0, 0x10, 0xFF, 0],
                "unit 1: write coil 0x0010: 0xff00, done",
            ),
            (
                &[16, 1, 0, 0, 2],
                "unit 1: write 2 registers from 0x0100, done",
            ),
            (
                &[0x0B, 0, 0, 1, 8],
                "unit 1: get comm event counter status 0000, count 264",
            ),
            (
                &[0x81, 2],
                "unit 1: exception 02, illegal data address, to read coils",
            ),
            (
                &[0xC1, 0x0B],
                "unit 1: exception 0b, gateway target device failed to respond, to do function 41",
            ),
            (&[0x94, 0x77], "unit 1: exception 77 to read file record"),
            (
                &[0x83, 2, 2],
                "unit 1: a broken exception to read holding registers",
            ),
        ] {
            assert_eq!(told(1, pdu, Direction::Response), text);
        }
    }

    #[test]
    fn bytes_that_are_not_a_frame_are_described_as_such() {
        for (bytes, text) in [
            (&[1, 2, 3][..], "3 bytes, too short for a frame"),
            (&[], "0 bytes, too short for a frame"),
            (&[1, 1, 0, 0, 0, 1, 9, 9], "8 bytes with a bad CRC"),
            (b":1103006B00037F\r\n", "17 bytes with a bad LRC"),
            (b":\r\n", "3 bytes with a bad LRC"),
            (&[0; 257], "257 bytes, too long for a frame"),
        ] {
            assert_eq!(frame(Direction::Request, bytes), text);
        }
    }
}
