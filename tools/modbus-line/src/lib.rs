//! What every host tool knows of a Modbus serial line.
//!
//! | module | contents |
//! |---|---|
//! | [`LineFormat`] | rate and character format, the time of a character, t1.5 and t3.5 |
//! | [`adu`] | frames in RTU, ASCII and TCP form: created, checked and measured |
//! | [`names`] | names of functions and exceptions |
//! | [`decode`] | frames, requests and responses in words, as in `modioctl sniff` and the simulator's frame log |
//! | [`capture`] | capture files that Wireshark reads |
//! | `port` | opens a serial port, with the feature `port` |
//! | [`fast`] | Fast Modbus, function 70: messages, scans and events |
//! | [`exact`] | the exact-line protocol: a serial line in virtual time |
//!
//! The crate only implements the standard, this protocol and one extension: it knows no device and has no clock.
//!
//! ```
//! use modbus_line::{Direction, adu::Framing, decode};
//!
//! let frame = Framing::Ascii.frame(0, 17, &[3, 0, 0x6B, 0, 3]);
//! assert_eq!(frame, b":1103006B00037E\r\n");
//! let words = decode::frame(Framing::Ascii, Direction::Request, &frame, None);
//! assert_eq!(words, "unit 17: read holding registers 0x006B x 3");
//! ```

#![forbid(unsafe_code)]

pub mod adu;
pub mod capture;
pub mod decode;
pub mod exact;
pub mod fast;
mod format;
pub mod names;
pub mod other;
#[cfg(feature = "port")]
pub mod port;
mod waiting;

pub use format::{Format, Limits, LineFormat, Parity, RATES, t35};
pub use waiting::Waiting;

/// Direction of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// To the unit.
    Request,
    /// From the unit.
    Response,
}
