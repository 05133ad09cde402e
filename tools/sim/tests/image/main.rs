//! The real release image on the virtual board: what a master on the line, and a person at the board,
//! get to see.
//!
//! The image comes from `MODIO_ELF`, which `cargo xtask test` sets after building it.

mod bench;
mod boot;
mod configuration;
mod dip;
mod framing;
mod functions;
mod modules;
mod noise;
mod points;
mod refusals;
mod registers;
mod timing;
