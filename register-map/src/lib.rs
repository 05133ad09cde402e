//! What a Modbus master finds in the device, as data: read by the firmware and by every tool, so that
//! both mean the same thing by an address.
//!
//! Addresses are PDU addresses, counted from zero as they stand in the frame.

#![no_std]
#![forbid(unsafe_code)]

mod module;
pub mod points;
pub mod preset;

pub use module::{Module, UnknownModule};
