//! A second Modbus serial-line server, as simple as possible and written only from the standard: V1.02 is *Modbus
//! over Serial Line*, V1.1b3 the *Modbus Application Protocol Specification*. Tests compare other servers with it.
//!
//! - [`framed`] and [`unframed`] are the master's side of the line; [`pdu`] and the functions after it create requests.
//! - [`Receiver`] returns what a unit must have received, from all characters of a frame at its end.
//! - [`Server`] serves requests for a [`Device`], and counts and logs them.
//! - [`Unit`] combines both.
//! - [`Modio`] has the points, registers and files of a modio. It is written from the register map, for tests of tools.

mod device;
mod frame;
mod modio;
mod receiver;
pub mod server;
mod serving;
mod unit;

pub use device::{Device, MAX_WORD, object};
pub use frame::{
    UNIT, ascii_frame, crc, frame, framed, judge_ascii, judge_rtu, lrc, pack, pdu, read_files,
    unframed, write_bits, write_files, write_then_read, write_words,
};
pub use modio::Modio;
pub use receiver::{Closed, LineCounters, Mode, Receiver};
pub use server::Server;
pub use serving::answer;
pub use unit::Unit;
