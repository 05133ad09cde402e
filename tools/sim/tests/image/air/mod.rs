//! Requests over the air.

mod faults;
mod requests;
mod several;
mod two_lines;
