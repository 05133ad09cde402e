//! The device's logic without its hardware, which the tasks of the application call. It is built and tested on the
//! host.

#![no_std]
#![forbid(unsafe_code)]

/// The device serves function 70.
pub const HAS_EVENTS: bool = !cfg!(feature = "small");

/// The device keeps the values of outputs that are to start as they were.
pub const KEEPS_OUTPUTS: bool = !cfg!(feature = "small");

/// The board has slots, a switch, and a radio as its second line: nothing about it is fixed.
pub const HAS_SLOTS: bool = cfg!(feature = "slots");

pub mod alive;
pub mod budget;
mod built;
pub mod byte_queue;
pub mod config;
pub mod device;
pub mod kept_outputs;
pub mod leds;
pub mod line;
pub mod links;
pub mod outputs;
pub mod repairs;
pub mod second;
pub mod start_up;
pub mod store;
pub mod update;
