//! The frames on the line, as JSON.

use std::fmt::Write as _;

use modbus_frames::sentence;
use serde_json::{Value, json};
use sim::Time;
use sim::line::{Direction, Frame, Line};

/// The body of `GET /api/frames`: the recorded frames with numbers above `since`, oldest first.
pub fn json(line: &Line, since: u64) -> Value {
    json!({ "frames": line.frames_since(since).map(frame).collect::<Vec<_>>() })
}

/// A frame as JSON.
pub fn frame(frame: &Frame) -> Value {
    let to_unit = frame.direction == Direction::FromMaster;
    json!({
        "number": frame.number,
        // From the view of the unit, as in `rx_frames` and `tx_frames`.
        "direction": if to_unit { "rx" } else { "tx" },
        "start_us": frame.start.as_us(),
        "end_us": frame.end.as_us(),
        "gap_us": frame.gap.map(Time::as_us),
        "turnaround_us": frame.turnaround.map(Time::as_us),
        "silence_us": frame.longest_gap.as_ns() as f64 / 1e3,
        "bytes": hex(&frame.bytes),
        "summary": summary(frame),
        "crc_ok": frame.crc_ok,
        "damaged": frame.damaged,
    })
}

/// The meaning of a frame as text.
pub fn summary(frame: &Frame) -> String {
    sentence::frame(way(frame.direction), &frame.bytes)
}

/// The direction of a frame, in the terms of the standard.
pub fn way(direction: Direction) -> modbus_frames::Direction {
    match direction {
        Direction::FromMaster => modbus_frames::Direction::Request,
        Direction::FromUnit => modbus_frames::Direction::Response,
    }
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

    #[test]
    fn frame_as_json_has_times_and_meaning() {
        let seen = Frame {
            number: 7,
            direction: Direction::FromMaster,
            start: Time::from_us(1500),
            end: Time::from_us(10_666),
            bytes: vec![0x01, 0x01, 0x00, 0x10, 0x00, 0x04, 0x3C, 0x0C],
            crc_ok: true,
            damaged: false,
            longest_gap: Time::from_ns(5_250),
            gap: Some(Time::from_us(1000)),
            turnaround: None,
        };
        let expected = json!({
            "number": 7,
            "direction": "rx",
            "start_us": 1500,
            "end_us": 10_666,
            "gap_us": 1000,
            "turnaround_us": null,
            "silence_us": 5.25,
            "bytes": "0101001000043c0c",
            "summary": "unit 1: read 4 coils from 0x0010",
            "crc_ok": true,
            "damaged": false,
        });
        assert_eq!(frame(&seen), expected);
    }
}
