//! A Modbus master: frames, the line, and the answers of units.

mod broadcast;
pub mod endpoint;
mod fast;
mod master;
mod stream;
mod sweep;

pub use modbus_line::{Direction, Waiting, adu, decode};

pub use endpoint::{Endpoint, Options, Place};
pub(crate) use fast::{check_line, shared};
pub use master::{Lost, MOST, Master, Observer, Seen};
pub(crate) use stream::Stream;
pub use sweep::{Found, LONG, REPORT, SHORT};

/// Returns whether an exception is the answer of a gateway for a unit that does not answer it (V1.1b3 chapter 7, codes
/// 0A and 0B).
pub const fn is_from_gateway(code: u8) -> bool {
    matches!(code, 0x0A | 0x0B)
}
