//! Tests of `modioctl` with the release image in the simulator: over a pseudo-terminal, over TCP and over Modbus
//! TCP. They need the simulator and the image, whose paths `cargo xtask test` passes in MODIO_SIM and MODIO_ELF.

#![cfg(unix)]

mod bus;
mod commands;
mod errors;
mod gateway;
mod hostile;
mod importing;
mod listening;
mod monitor;
mod newer;
mod ordinary;
mod program;
mod restart;
mod scanning;
mod screen;
mod served;
mod terminal;
mod trouble;
mod unit;
