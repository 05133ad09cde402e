//! A second Modbus serial-line server, in the plainest form, written only from the standard: V1.02 is *Modbus over
//! Serial Line*, V1.1b3 the *Modbus Application Protocol Specification*. Tests compare other servers with this one.
//!
//! - [`framed`] and [`unframed`] are a master's side of the line; [`pdu`] and the functions after it make requests.
//! - [`Receiver`] judges a frame by its whole text, at the end of the frame.
//! - [`Server`] serves requests for a [`Device`], and counts and logs them.
//! - [`Unit`] is a receiver with a server.

mod device;
mod frame;
mod receiver;
pub mod server;
mod serving;
mod unit;

pub use device::{Device, MAX_WORD, object};
pub use frame::{
    UNIT, ascii_frame, crc, frame, framed, judge_ascii, judge_rtu, lrc, pack, pdu, read_files,
    unframed, write_bits, write_files, write_then_read, write_words,
};
pub use receiver::{Closed, LineCounters, Mode, Receiver};
pub use server::Server;
pub use serving::answer;
pub use unit::Unit;
