//! What a receiver remembers of a frame, as a set of bits, and the lengths of frames.
//!
//! The set is empty while all is well in the middle of an RTU frame; its bits lie above those of
//! [`Faults`](super::Faults). So one test finds out whether a character is just the next good one.

/// Everything is ignored up to the next t3.5.
pub(super) const DEAF: u16 = 1 << 4;
/// No frame yet: the next character, or colon, starts one.
pub(super) const IDLE: u16 = 1 << 5;
/// t1.5 has passed since the last character.
pub(super) const PAUSED: u16 = 1 << 6;
/// Always set in ASCII mode, never in RTU mode.
pub(super) const ASCII: u16 = 1 << 7;
/// In ASCII mode, with a buffer, nothing begun.
pub(super) const ASCII_IDLE: u16 = ASCII | IDLE;
/// A gap above t1.5 was in the frame, and that is not tolerated.
pub(super) const TORN: u16 = 1 << 8;
/// A character that is faulty, or wrong where it stands, or too many of them.
pub(super) const SPOILED: u16 = 1 << 9;
/// One of the faults was an overrun.
pub(super) const OVERRUN: u16 = 1 << 10;
/// There was no buffer when the frame started: it is only followed. While idle: there is none.
pub(super) const UNKEPT: u16 = 1 << 11;

// The shortest and the longest frame in bytes, and how many of them are the check.

/// Unit address, function code and CRC; 253 bytes of PDU at the most.
pub(super) const RTU: (usize, usize, usize) = (4, 256, 2);
/// Unit address, function code and LRC; 253 bytes of PDU at the most.
pub(super) const ASCII_ENDED: (usize, usize, usize) = (3, 255, 1);
/// No length is right for a frame without its end.
pub(super) const NOT_ENDED: (usize, usize, usize) = (1, 0, 0);
