//! An update over the line, from the side of the master: the file with the images, and the plan that brings an image to
//! one unit or to many.
//!
//! [`Campaign`] decides what to send and what the answers mean. It sends nothing and has no clock, so that it can be
//! tested against models of units, on any line, in any time.

mod campaign;
mod fault;
pub mod file;
mod keys;
mod messages;
mod unit;

#[cfg(test)]
mod tests;

pub use campaign::{Campaign, Patience, Step};
pub use fault::{Fault, reason_text, state_text};
pub use file::{File, Image};
pub use keys::key_name;
pub use messages::{Status, read_status};
pub use unit::{Stage, Unit};
