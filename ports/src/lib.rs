//! What the logic of modio needs of the hardware, and what both say to each other: a line with its UART and timer, pages
//! of flash, settings of a UART, marks of tasks.
//!
//! Crate `board-support` implements the traits for the microcontroller, tests implement them for the host.

#![no_std]

pub mod line;
pub mod line_settings;
pub mod marks;
pub mod pages;
