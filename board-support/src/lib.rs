//! The modio-02 board: an STM32F103CB (or a bare "Blue Pill" with a transceiver) as named devices.
//!
//! [`setup`](board::setup) brings the clocks up, reads the DIP switch and returns one
//! [`Board`](board::Board) whose fields are the devices. This is the only crate that names the HAL; a
//! port to another board is a new module beside [`board`]. What needs no hardware ([`design`],
//! [`uart`], [`gap`]) is built and tested on the host.

#![no_std]

pub mod design;
pub mod gap;
pub mod uart;

#[cfg(target_os = "none")]
pub mod board;
#[cfg(target_os = "none")]
mod clock;
#[cfg(target_os = "none")]
mod dip;
#[cfg(target_os = "none")]
pub mod flash;
#[cfg(target_os = "none")]
mod gap_timer;
#[cfg(target_os = "none")]
mod leds;
#[cfg(target_os = "none")]
mod rs485;
#[cfg(target_os = "none")]
mod scan_timer;
#[cfg(target_os = "none")]
mod slot;
#[cfg(target_os = "none")]
mod watchdog;

#[cfg(target_os = "none")]
pub use {
    clock::ClockSource,
    gap_timer::{GapEvent, GapTimer},
    leds::Leds,
    rs485::{Character, Rs485, Status},
    scan_timer::ScanTimer,
    slot::{Slot, SlotInput, SlotOutput},
    stm32f1xx_hal::pac,
    watchdog::Watchdog,
};
