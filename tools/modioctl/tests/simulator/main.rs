//! Tests of `modioctl` as a program: with units that the tests serve themselves, and with loader and release image in the
//! simulator, over a pseudo-terminal, over TCP and over Modbus TCP. The latter are ignored unless `cargo xtask test` runs
//! them, which passes the path of the simulator in MODIO_SIM, and the directories of the images.

#![cfg(unix)]

mod behind_gateway;
mod bus;
mod closed;
mod commands;
mod ending;
mod errors;
mod fast;
mod gateway;
mod hostile;
mod importing;
mod links;
mod listening;
mod monitor;
mod naming;
mod newer;
mod ordinary;
mod program;
mod restart;
mod scanning;
mod served;
mod stage;
mod strange;
mod terminal;
mod trouble;
mod unit;
mod updating;
mod watching;
