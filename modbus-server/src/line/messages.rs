//! Messages of Fast Modbus, which end without a silence.

use super::length;
use crate::Adu;
use crate::fast::{ADDRESS, FUNCTION, SERIAL_AHEAD, sub};

/// Kinds of messages that end at their last byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Message {
    Request,
    Reply,
}

impl Message {
    /// Returns the kind of a frame with a valid CRC, if it has the length of such a message.
    pub(super) fn of(frame: &Adu) -> Option<Self> {
        if frame.get(1) != FUNCTION {
            return None;
        }
        let len = frame.len();
        let to_all = frame.get(0) == ADDRESS;
        let ahead = SERIAL_AHEAD;
        let (is_whole, kind) = match frame.get(2) {
            sub::EVENTS => (len == 8 + usize::from(frame.get(5)), Self::Reply),
            _ if !to_all => return None,
            sub::START_SCAN | sub::CONTINUE_SCAN => (len == 5, Self::Request),
            sub::FETCH => (len == 9, Self::Request),
            sub::REQUEST => (length::is_request(frame, ahead), Self::Request),
            sub::FOUND => (len == 10, Self::Reply),
            sub::NONE_LEFT | sub::NO_EVENTS => (len == 5, Self::Reply),
            sub::REPLY => (
                length::is_reply(frame, ahead) || length::is_request(frame, ahead),
                Self::Reply,
            ),
            _ => return None,
        };
        is_whole.then_some(kind)
    }
}

/// Returns whether a reply begins with these bytes.
#[inline]
pub(super) fn begins_reply(unit: u8, function: u8, sub: u8) -> bool {
    let of_all = matches!(
        sub,
        sub::FOUND | sub::NONE_LEFT | sub::REPLY | sub::NO_EVENTS
    );
    function == FUNCTION && (sub == sub::EVENTS || of_all && unit == ADDRESS)
}
