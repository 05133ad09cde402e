//! Drivers of the plug-in I/O modules.
//!
//! A module has four channels. Its driver implements [`IoModule`]: once a millisecond it brings what
//! its inputs show into [`Channels`] and drives its outputs as [`Channels`] says. That is all the rest
//! of the device sees of a module, so a new module is one new file here.
//!
//! Drivers are generic over embedded-hal, know nothing of Modbus or of the board, do no floating
//! point and wait for nothing.

#![no_std]
#![forbid(unsafe_code)]

mod channels;
mod di4;
mod do4;
mod io_module;

pub use channels::{CHANNELS, Channels, Kind};
pub use di4::{DEBOUNCE_DEFAULT_MS, DEBOUNCE_MAX_MS, Di4};
pub use do4::Do4;
pub use io_module::{Absent, IoModule, ModuleError};
