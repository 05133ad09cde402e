//! The frames on the line, as JSON.

use std::fmt::Write as _;

use modbus_line::{adu::Framing, decode};
use serde::Serialize;
use sim::Time;
use sim::line::{Direction, Frame, Line};
use utoipa::ToSchema;

/// The frames on the line.
#[derive(Serialize, ToSchema)]
pub struct Frames {
    frames: Vec<OneFrame>,
}

/// A frame on the line.
#[derive(Serialize, ToSchema)]
#[schema(as = Frame)]
pub struct OneFrame {
    number: u64,
    direction: Way,
    start_us: u64,
    end_us: u64,
    /// Silence before the frame, since the end of the frame before; null for the first frame.
    #[schema(required)]
    gap_us: Option<u64>,
    /// For the reply to a request: the time from the end of the request to the start of the reply; null for any other
    /// frame.
    #[schema(required)]
    turnaround_us: Option<u64>,
    /// Longest silence between two characters of the frame.
    silence_us: f64,
    /// The bytes of the frame in hexadecimal.
    bytes: String,
    summary: String,
    /// The CRC is right, or the LRC of an ASCII frame.
    crc_ok: bool,
    /// A character was bad, or two senders were active.
    damaged: bool,
}

/// Direction from the view of the unit: `rx` is a frame to the unit, `tx` a frame from the unit.
#[derive(Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
#[schema(as = Direction)]
enum Way {
    Rx,
    Tx,
}

/// Returns the recorded frames with numbers above `since`, oldest first.
pub fn since(line: &Line, since: u64) -> Frames {
    Frames {
        frames: line.frames_since(since).map(frame).collect(),
    }
}

/// Returns a frame as it is in JSON.
pub fn frame(frame: &Frame) -> OneFrame {
    OneFrame {
        number: frame.number,
        direction: match frame.direction {
            Direction::Request => Way::Rx,
            Direction::Response => Way::Tx,
        },
        start_us: frame.start.as_us(),
        end_us: frame.end.as_us(),
        gap_us: frame.gap.map(Time::as_us),
        turnaround_us: frame.turnaround.map(Time::as_us),
        silence_us: frame.longest_gap.as_ns() as f64 / 1e3,
        bytes: hex(&frame.bytes),
        summary: summary(frame),
        crc_ok: frame.crc_ok,
        damaged: frame.damaged,
    }
}

/// Returns the meaning of a frame as text, as in `modioctl sniff`.
pub fn summary(frame: &Frame) -> String {
    let framing = Framing::on_line(&frame.bytes).unwrap_or_default();
    let request = frame.request.as_deref();
    decode::frame(framing, frame.direction, &frame.bytes, request)
}

/// Returns bytes in hexadecimal.
pub fn hex(bytes: &[u8]) -> String {
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
    use serde_json::json;

    use super::*;

    #[test]
    fn frame_as_json_has_times_and_meaning() {
        let seen = Frame {
            number: 7,
            direction: Direction::Request,
            start: Time::from_us(1500),
            end: Time::from_us(10_666),
            bytes: vec![0x01, 0x01, 0x00, 0x10, 0x00, 0x04, 0x3C, 0x0C],
            crc_ok: true,
            damaged: false,
            longest_gap: Time::from_ns(5_250),
            gap: Some(Time::from_us(1000)),
            turnaround: None,
            request: None,
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
            "summary": "unit 1: read coils 0x0010 x 4",
            "crc_ok": true,
            "damaged": false,
        });
        assert_eq!(serde_json::to_value(frame(&seen)).unwrap(), expected);
    }

    #[test]
    fn summary_of_a_reply_has_the_address_of_its_request_and_the_values() {
        let reply = Frame {
            number: 2,
            direction: Direction::Response,
            start: Time::ZERO,
            end: Time::ZERO,
            bytes: Framing::Rtu.frame(0, 1, &[1, 1, 0x05]),
            crc_ok: true,
            damaged: false,
            longest_gap: Time::ZERO,
            gap: None,
            turnaround: Some(Time::ZERO),
            request: Some(vec![1, 0, 0x10, 0, 4]),
        };
        assert_eq!(summary(&reply), "unit 1: read coils 0x0010 = 1010");
    }
}
