//! RTU transmission mode: frames of bytes, set apart by silence and closed by a CRC (V1.02 2.5.1).

mod faults;
mod gaps;
mod receiver;
mod transmitter;

pub use faults::Faults;
pub use gaps::Gaps;
pub use receiver::{Closed, Receiver};
pub use transmitter::{Next, Transmitter};
