//! A Modbus master: frames, the line they go over, and the unit's answers.

pub mod adu;
pub mod decode;
pub mod endpoint;
pub mod format;
mod master;
mod stream;
mod sweep;
mod waiting;

pub use endpoint::{Endpoint, Options, Place};
pub use master::{Direction, Lost, Master, Observer, Seen};
pub(crate) use stream::{Stream, is_pseudo_terminal};
pub use sweep::{Found, SHORT};
pub use waiting::Waiting;
