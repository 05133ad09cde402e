//! `modioctl`: finds, sets up, watches and updates modio units over Modbus, on a serial port, over TCP and over Modbus
//! TCP.
//!
//! The program is [`run`]. Its tests also use the modules that are public.

#![forbid(unsafe_code)]

/// Prints on standard error, in place of the macro of the standard library, which panics when standard error is closed.
/// Nobody reads the text then, and the command goes on.
#[macro_export]
macro_rules! eprint {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = write!(std::io::stderr(), $($text)*);
    }};
}

/// Prints a line as [`eprint!`] does.
#[macro_export]
macro_rules! eprintln {
    ($($text:tt)*) => { $crate::eprint!("{}\n", format_args!($($text)*)) };
}

mod adapter;
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
mod warnings;

pub use commands::run;
