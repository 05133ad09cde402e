//! Possible lengths of a frame, and the decision whether a frame is a request or a response.

use std::time::Duration;

use modbus_line::fast::{self, sub};
use modbus_line::names;

use super::Request;
use crate::bus::adu::{Framing, request_length, response_length};
use crate::bus::{Direction, Waiting};

/// Highest exception code of the standard (V1.1b3, 7).
const LAST_EXCEPTION: u8 = 0x0B;

/// Bytes of the shortest RTU frame: unit, function, CRC.
pub const SHORTEST: usize = 4;

/// The length of a frame that starts with certain bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Length {
    Known(usize),
    /// More bytes are needed to know the length.
    Later,
}

/// Returns the lengths that an RTU frame with this beginning can have: as the response to `open`, as a request, and as
/// a response to a request that the listener did not receive. Returns no length when `bytes` cannot start a frame.
pub fn lengths(bytes: &[u8], open: Option<&Request>) -> Vec<Length> {
    let Some(unit) = bytes.first() else {
        return vec![Length::Later];
    };
    let Some(function) = bytes.get(1) else {
        return match unit {
            248..=252 | 254 => Vec::new(),
            _ => vec![Length::Later],
        };
    };
    if *function == fast::FUNCTION {
        return fast_length(bytes, open).into_iter().collect();
    }
    if (248..=254).contains(unit) {
        return Vec::new();
    }
    if names::function(*function).is_none() && function & 0x7F != fast::FUNCTION {
        return Vec::new();
    }
    if function & 0x80 != 0 {
        return match bytes.get(2) {
            None => vec![Length::Later],
            Some(1..=LAST_EXCEPTION) => vec![Length::Known(5)],
            Some(_) => Vec::new(),
        };
    }
    let known = |length: Option<usize>| length.map_or(Length::Later, Length::Known);
    let request = open.map_or(&bytes[1..], |open| &open.pdu);
    // Function 2B with another type than 0E has no known length.
    if *function == 0x2B && bytes.get(2).is_some_and(|kind| *kind != 0x0E) {
        return Vec::new();
    }
    let response = match (*function, open) {
        // A response of these functions repeats its request, so both have the same length.
        (0x08, None) => Some(8),
        (0x15, _) => request_length(bytes),
        _ => response_length(request, bytes),
    };
    vec![known(response), known(request_length(bytes))]
}

/// Returns the length of the message of Fast Modbus with this beginning; `None` when `bytes` cannot start one.
fn fast_length(bytes: &[u8], open: Option<&Request>) -> Option<Length> {
    let Some(sub) = bytes.get(2) else {
        return Some(Length::Later);
    };
    let counted = |at: usize| bytes.get(at).map(|count| at + 1 + usize::from(*count) + 2);
    // The last byte of the serial number stands for the unit address of a usual frame.
    let inside = bytes.get(6..).unwrap_or_default();
    let is_to_all = bytes.first() == Some(&fast::ADDRESS);
    let length = match (is_to_all, *sub) {
        (true, sub::START_SCAN | sub::CONTINUE_SCAN | sub::NONE_LEFT | sub::NO_EVENTS) => Some(5),
        (true, sub::FOUND) => Some(10),
        (true, sub::FETCH) => Some(9),
        (true, sub::REQUEST) => request_length(inside).map(|length| 6 + length),
        (true, sub::REPLY) => {
            let asked = open.and_then(|open| open.pdu.get(6..)).unwrap_or_default();
            response_length(asked, inside).map(|length| 6 + length)
        }
        (false, sub::EVENTS) => counted(5),
        (false, sub::SETTINGS) => counted(3),
        _ => return None,
    };
    Some(length.map_or(Length::Later, Length::Known))
}

/// Returns the request in `open` if a frame of this unit and function can answer that request. A frame that starts
/// more than `patience` after the request does not answer it.
pub fn asked(
    open: Option<&Request>,
    unit: u8,
    function: u8,
    from: Duration,
    patience: Duration,
) -> Option<&Request> {
    open.filter(|open| {
        open.unit == unit
            && open.pdu.first() == Some(&(function & 0x7F))
            && from.saturating_sub(open.until) <= patience
    })
}

/// Returns the direction of a frame. `open` is the request that the frame can answer, if any.
pub fn direction(unit: u8, pdu: &[u8], open: Option<&Request>) -> Direction {
    let function = pdu.first().copied().unwrap_or_default();
    if function & 0x80 != 0 {
        return Direction::Response;
    }
    if let [fast::FUNCTION, sub, ..] = pdu
        && *sub != sub::SETTINGS
    {
        return match *sub {
            sub::FOUND | sub::NONE_LEFT | sub::REPLY | sub::EVENTS | sub::NO_EVENTS => {
                Direction::Response
            }
            _ => Direction::Request,
        };
    }
    let mut frame = vec![unit];
    frame.extend(pdu);
    let length = Some(frame.len() + 2);
    if let Some(open) = open {
        let waiting = Waiting {
            framing: Framing::Rtu,
            transaction: 0,
            unit,
            pdu: &open.pdu,
        };
        // Requests and responses of functions 05, 06, 08 and 16 look the same: they alternate.
        if waiting.fits(pdu) && (response_length(&open.pdu, &frame) == length) {
            return Direction::Response;
        }
    }
    let is_request = request_length(&frame) == length;
    let is_response = response_length(pdu, &frame) == length;
    match (is_request, is_response) {
        (true, _) => Direction::Request,
        (false, true) => Direction::Response,
        // The function is unknown, or the frame has an unusual length.
        (false, false) if open.is_some() => Direction::Response,
        (false, false) => Direction::Request,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(pdu: &[u8]) -> Request {
        Request {
            unit: 1,
            pdu: pdu.to_vec(),
            until: Duration::ZERO,
        }
    }

    #[test]
    fn same_looking_frames_alternate() {
        let write = [6, 0, 0x12, 0, 5];
        assert_eq!(direction(1, &write, None), Direction::Request);
        let open = request(&write);
        assert_eq!(direction(1, &write, Some(&open)), Direction::Response);
        let other = [6, 0, 0x12, 0, 6];
        assert_eq!(direction(1, &other, Some(&open)), Direction::Request);
    }

    #[test]
    fn response_that_has_the_length_of_a_request_follows_its_request() {
        // Three bytes of coils make a response of 8 bytes, as long as the request.
        let answer = [1, 3, 0xFF, 0xFF, 0x0F];
        let open = request(&[1, 0, 0, 0, 20]);
        assert_eq!(direction(1, &answer, Some(&open)), Direction::Response);
        assert_eq!(direction(1, &answer, None), Direction::Request);
    }

    #[test]
    fn repeated_read_request_is_a_request() {
        let read = [3, 0, 0x10, 0, 2];
        let open = request(&read);
        assert_eq!(direction(1, &read, Some(&open)), Direction::Request);
        assert_eq!(direction(1, &[3, 4, 0, 1, 0, 2], None), Direction::Response);
        assert_eq!(direction(1, &[0x83, 2], None), Direction::Response);
    }

    #[test]
    fn late_frame_does_not_answer_the_request() {
        let open = request(&[3, 0, 0, 0, 1]);
        let second = Duration::from_secs(1);
        let answered = |unit, function, from| asked(Some(&open), unit, function, from, second);
        assert!(answered(1, 3, second).is_some());
        assert!(answered(1, 0x83, second).is_some());
        assert!(answered(1, 3, second * 2).is_none());
        assert!(answered(2, 3, second).is_none());
        assert!(answered(1, 4, second).is_none());
    }
}
