//! The device's logic without its hardware, which the tasks of the application call. It is built and tested on the
//! host.

#![no_std]
#![forbid(unsafe_code)]

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
pub mod stage;
pub mod start_up;
pub mod store;
pub mod update;
