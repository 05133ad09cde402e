//! The two transmission modes, between the characters on the line and requests and replies (V1.02 2.5).
//!
//! RTU frames are bytes, separated by silence and ended by a CRC. ASCII frames are pairs of hexadecimal digits
//! between a colon and an end mark, with an LRC. A [`Port`] supports both; its [`Receiver`] selects the mode. All
//! other parts are the same for both modes.

mod arbitration;
mod ascii;
mod faults;
mod framing;
mod gaps;
mod length;
mod messages;
mod port;
mod receiver;
mod state;
mod timed;
mod transmitter;
mod units;

pub use arbitration::{Arbitration, Ending, Step, Windows};
pub use ascii::Width;
pub use faults::Faults;
pub use framing::Framing;
pub use gaps::Gaps;
pub use port::{Port, Turn};
pub use receiver::Receiver;
pub use timed::{Silences, TimedPort};
use transmitter::Transmitter;
pub use units::{FastUnit, UnitSet, Units};
