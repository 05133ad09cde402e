//! The LoRa radio: an Ebyte E32-433T20D, a module that sends the bytes at its UART over the air and back.
//!
//! [`Module`] is the module: its pins M0, M1, AUX, RXD and TXD, its UART, its commands, and its packets. [`Air`] is
//! everything outside the boards: the gateway radio of the master, which is a module of the same type, other
//! transmitters, and a record of the packets.
//!
//! ```text
//! the part --- RXD, TXD, M0, M1, AUX --- Module ---+
//! other boards --------------------------- Module ---+--- packets --- Module of the gateway --- Air::send, received
//!                                                    +--- Air::transmit
//! ```
//!
//! The air is ideal except for [`Air::set_loss`]: every module receives every packet of its channel at any distance.
//! Two packets that overlap on a channel destroy each other for every receiver, and a module that sends receives
//! nothing. Every instant is virtual time, and the same calls give the same run.
//!
//! # Sources
//!
//! The behaviour is that of the maker's manual (E32-433T20D, 2022). The manual leaves durations open. [`timing`] lists
//! every duration, and whether it is from the manual or an assumption. Further points that the manual leaves open, as
//! they are modelled:
//!
//! - A command must be complete and alone: after a pause of three byte times the module drops bytes that are no command.
//! - Bytes at the UART are lost while AUX is low because of a start or a command.
//! - A module begins to send without a look at the channel, and loses a packet that it is receiving then.
//! - Bytes with a framing or parity error are taken as they were sampled.
//! - Without push-pull outputs (bit 6 of OPTION clear) AUX is only pulled low. TXD is assumed to have a pull-up.
//!
//! Not modelled: fixed transmission (bit 7 of OPTION; it is a finding), the signal strength (the power has no effect),
//! and errors inside a packet.

mod air;
mod antenna;
mod command;
mod module;
mod packet;
mod parameters;
mod sending;
pub mod timing;

#[cfg(test)]
mod tests;

pub use crate::uart::Byte;
pub use air::Air;
pub(crate) use air::tell;
pub use module::{Fault, Module};
pub(crate) use packet::News;
pub use packet::{Packet, Sender};
pub(crate) use parameters::SLEEP_UART;
pub use parameters::{Mode, Parameters};
