//! A Modbus master: frames, the line, and the answers of units.

mod answer;
mod ask;
mod broadcast;
pub mod endpoint;
mod fast;
mod gateway;
mod late;
mod master;
mod stream;
mod sweep;

pub use modbus_line::{Direction, Waiting, adu, decode};

pub use answer::{Lost, MOST, PROBE, is_busy};
pub use endpoint::{Endpoint, Options, Place};
pub(crate) use fast::{check_line, shared};
pub use gateway::sufficient;
pub use master::{Master, Observer, Seen};
pub(crate) use stream::Stream;
pub use sweep::{Found, LONG, REPORT, SHORT};
