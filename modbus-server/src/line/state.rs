//! The receiver's state of a frame, as a set of bits, and the lengths of frames.
//!
//! The set is empty in the middle of a valid RTU frame, and its bits lie above those of [`Faults`](super::Faults).
//! So a single test finds out whether a character is the next valid one.

/// Everything is ignored up to the next t3.5.
pub(super) const DEAF: u16 = 1 << 4;
/// No frame yet: the next character or colon starts one.
pub(super) const IDLE: u16 = 1 << 5;
/// t1.5 has passed since the last character.
pub(super) const PAUSED: u16 = 1 << 6;
/// Always set in ASCII mode, never in RTU mode.
pub(super) const ASCII: u16 = 1 << 7;
/// In ASCII mode, with a buffer, no frame begun.
pub(super) const ASCII_IDLE: u16 = ASCII | IDLE;
/// The frame contained a gap longer than t1.5, which is not tolerated.
pub(super) const TORN: u16 = 1 << 8;
/// The frame contained a faulty character, a character that is not allowed at its place, or too many characters.
pub(super) const SPOILED: u16 = 1 << 9;
/// One of the faults was an overrun.
pub(super) const OVERRUN: u16 = 1 << 10;
/// No buffer was free when the frame started, so the frame is only followed. While idle: no buffer is free.
pub(super) const UNKEPT: u16 = 1 << 11;
/// In RTU mode, after a request of Fast Modbus, until its reply: the characters of an arbitration may be in front of the
/// reply. No error is counted.
pub(super) const FOLLOWS: u16 = 1 << 12;
/// In RTU mode, after that reply until the next t3.5: no error is counted.
pub(super) const QUIET: u16 = 1 << 13;
/// In RTU mode, after a gap longer than t1.5 in a frame: if that is the rest of a damaged request of Fast Modbus, its
/// reply may follow without t3.5 of silence in between.
pub(super) const SEEKS: u16 = 1 << 14;

// Shortest and longest frame in bytes, and the number of bytes of the checksum.

/// Unit address, function code and CRC, with a PDU of at most 253 bytes.
pub(super) const RTU: (usize, usize, usize) = (4, 256, 2);
/// Unit address, function code and LRC, with a PDU of at most 253 bytes.
pub(super) const ASCII_ENDED: (usize, usize, usize) = (3, 255, 1);
/// A frame without its end has no valid length.
pub(super) const NOT_ENDED: (usize, usize, usize) = (1, 0, 0);
