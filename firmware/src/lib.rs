//! The device's logic without its hardware: what the tasks of the application do, in a form that runs
//! and is tested on the host.

#![no_std]
#![forbid(unsafe_code)]

pub mod alive;
mod built;
pub mod config;
pub mod device;
pub mod lamps;
pub mod line;
pub mod start_up;
pub mod store;
