//! `modioctl`: finds, sets up, watches and updates modio units over Modbus, on a serial port, over TCP and over Modbus
//! TCP.
//!
//! The program is [`run`]. Its tests also use the modules that are public.

#![forbid(unsafe_code)]

pub mod bus;
pub mod cli;
mod commands;
mod device;
pub mod export;
pub mod failure;
mod held;
mod input;
mod links;
mod listing;
mod monitor;
pub mod names;
mod output;
mod sniff;
mod trace;
pub mod update;
mod value;

pub use commands::run;
