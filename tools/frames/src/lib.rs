//! Modbus frames on serial lines and TCP connections: built, checked, described in words, and written to capture files.
//!
//! | module | contents |
//! |---|---|
//! | [`adu`] | frames in RTU, ASCII and TCP form: built, checked and measured |
//! | [`names`] | names of functions and exceptions |
//! | [`decode`] | requests and responses in words, as `modioctl sniff` shows them |
//! | [`sentence`] | a frame as a sentence, as the simulator's log shows it |
//! | [`capture`] | capture files that Wireshark reads |
//!
//! The crate contains only what the standard defines: no device, no line and no clock. The host tool, the simulator
//! and the conformance suite use it.
//!
//! ```
//! use modbus_frames::{Direction, adu::Framing, decode, sentence};
//!
//! let frame = Framing::Ascii.frame(0, 17, &[3, 0, 0x6B, 0, 3]);
//! assert_eq!(frame, b":1103006B00037E\r\n");
//! let words = decode::frame(Framing::Ascii, Direction::Request, &frame, None);
//! assert_eq!(words, "unit 17: read holding registers 0x006B x 3");
//! let sentence = sentence::frame(Direction::Request, &frame);
//! assert_eq!(sentence, "unit 17: read 3 holding registers from 0x006b");
//! ```

#![forbid(unsafe_code)]

pub mod adu;
pub mod capture;
pub mod decode;
pub mod names;
pub mod sentence;
mod waiting;

pub use waiting::Waiting;

/// Direction of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// To the unit.
    Request,
    /// From the unit.
    Response,
}
