//! `modioctl`: finds, sets up and watches modio units over Modbus, on a serial port, over TCP and over Modbus TCP.
//!
//! The program is [`run`]. Other programs can use the modules below it: [`bus::Master`] sends requests to units,
//! [`device::Device`] reads and writes one unit with errors as texts, [`names::Book`] knows its points and
//! registers by name.

#![forbid(unsafe_code)]

pub mod bus;
pub mod cli;
pub mod commands;
pub mod device;
pub mod export;
pub mod failure;
mod listing;
pub mod monitor;
pub mod names;
pub mod output;
pub mod sniff;
pub mod trace;
pub mod value;

pub use commands::run;
