//! A Modbus master: frames, the line, and the answers of units.

pub mod endpoint;
pub mod format;
mod master;
mod stream;
mod sweep;

pub use modbus_frames::{Direction, Waiting, adu, decode};

pub use endpoint::{Endpoint, Options, Place};
pub use master::{Lost, Master, Observer, Seen};
pub(crate) use stream::{Stream, is_pseudo_terminal};
pub use sweep::{Found, SHORT};
