//! Lengths of RTU frames, as far as function and content determine them (V1.1b3 section 6).
//!
//! The frames are whole: from the unit address to the CRC. A byte count that is not in use yet may have any value,
//! because the length that it gives is that of a frame with the byte count in use.

use crate::Adu;

/// The type of function 2B for device identification (V1.1b3 6.21).
const IDENTIFICATION: u8 = 0x0E;

/// Returns the length of a request with the function of this frame, if the function determines it. `ahead`: number of bytes
/// in front of the unit address.
///
/// A request of function 08 may have any length. Here it has the usual one, with a single data word.
pub(super) fn of_request(frame: &Adu, ahead: u8) -> Option<usize> {
    let byte = |at| frame.get(ahead + at);
    let count = |at| usize::from(byte(at));
    let length = match byte(1) {
        0x01..=0x06 | 0x08 => 8,
        0x07 | 0x0B | 0x0C | 0x11 => 4,
        0x0F | 0x10 => 9 + count(6),
        0x14 | 0x15 => 5 + count(2),
        0x16 => 10,
        0x17 => 13 + count(10),
        0x18 => 6,
        0x2B if byte(2) == IDENTIFICATION => 7,
        _ => return None,
    };
    Some(usize::from(ahead) + length)
}

/// Returns whether a frame has the length of a request with its function, as [`of_request`].
pub(super) fn is_request(frame: &Adu, ahead: u8) -> bool {
    of_request(frame, ahead) == Some(frame.len())
}

/// Returns whether a frame has the length of a reply with its function. `ahead` as for [`of_request`].
///
/// Functions 05, 06, 08, 14, 15 and 16 are omitted: their replies have the lengths of their requests.
pub(super) fn is_reply(frame: &Adu, ahead: u8) -> bool {
    let byte = |at| frame.get(ahead + at);
    let count = |at| usize::from(byte(at));
    let length = match byte(1) {
        // A reply without data does not exist, but the first bytes of a request can look like one.
        0x01..=0x04 | 0x0C | 0x11 | 0x17 if byte(2) != 0 => 5 + count(2),
        0x07 | 0x80.. => 5,
        0x0B | 0x0F | 0x10 => 8,
        0x18 => 6 + 256 * count(2) + count(3),
        0x2B if byte(2) == IDENTIFICATION => identification(frame, ahead),
        _ => return false,
    };
    frame.len() == usize::from(ahead) + length
}

/// Returns the length of a reply with objects of the device identification.
fn identification(frame: &Adu, ahead: u8) -> usize {
    let mut length = 10;
    for _ in 0..frame.get(ahead + 7) {
        // Id and length of the object, in front of its text. The index is only truncated when the length is already
        // more than that of a frame.
        length += 2 + usize::from(frame.get(ahead.wrapping_add((length - 1) as u8)));
    }
    length
}
