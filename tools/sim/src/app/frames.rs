//! The frames on the line, as JSON.

use std::fmt::Write as _;

use serde_json::{Value, json};
use sim::line::{Direction, Frame, Line};

use super::summary;

/// The body of `GET /api/frames`: the frames kept whose numbers are above `since`, oldest first.
pub fn json(line: &Line, since: u64) -> Value {
    json!({ "frames": line.frames_since(since).map(frame).collect::<Vec<_>>() })
}

/// A frame.
pub fn frame(frame: &Frame) -> Value {
    let to_unit = frame.direction == Direction::FromMaster;
    json!({
        "number": frame.number,
        // As the unit sees it, and as `rx_frames` and `tx_frames` count it.
        "direction": if to_unit { "rx" } else { "tx" },
        "start_us": frame.start.as_us(),
        "end_us": frame.end.as_us(),
        "bytes": hex(&frame.bytes),
        "summary": summary::of(&frame.bytes, to_unit, frame.crc_ok),
        "crc_ok": frame.crc_ok,
        "damaged": frame.damaged,
    })
}

fn hex(bytes: &[u8]) -> String {
    bytes
        .iter()
        .fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
            // Writing to a string cannot fail.
            let _ = write!(text, "{byte:02x}");
            text
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::Time;

    #[test]
    fn a_frame_is_told_with_its_times_and_meaning() {
        let seen = Frame {
            number: 7,
            direction: Direction::FromMaster,
            start: Time::from_us(1500),
            end: Time::from_us(10_666),
            bytes: vec![0x01, 0x01, 0x00, 0x10, 0x00, 0x04, 0x3C, 0x0C],
            crc_ok: true,
            damaged: false,
            longest_gap: Time::ZERO,
        };
        let expected = json!({
            "number": 7,
            "direction": "rx",
            "start_us": 1500,
            "end_us": 10_666,
            "bytes": "0101001000043c0c",
            "summary": "unit 1: read 4 coils from 0x0010",
            "crc_ok": true,
            "damaged": false,
        });
        assert_eq!(frame(&seen), expected);
    }
}
