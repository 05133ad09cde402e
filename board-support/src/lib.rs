//! The boards, each an STM32F103 with the devices on its pins, as named fields.
//!
//! `board::setup` starts the clocks, reads the DIP switch and returns one `Board` whose fields are the devices.
//! This is the only crate that uses the HAL. A port to another board is a descriptor in [`boards`]. The parts
//! without hardware access ([`design`], [`baud_rate`], [`gap_ticks`], the logic of [`fault`] and of the
//! recovery of an I2C bus) are built and tested on the host.

#![no_std]

pub mod baud_rate;
pub mod boards;
pub mod design;
pub mod fault;
mod full_scale;
pub mod gap_ticks;
pub mod gesture;
#[cfg(any(target_os = "none", test))]
mod i2c;
pub mod kept;
mod pin;
mod usart;

#[cfg(target_os = "none")]
mod adc;
#[cfg(target_os = "none")]
pub mod board;
#[cfg(target_os = "none")]
mod clock;
#[cfg(target_os = "none")]
mod crc_unit;
#[cfg(target_os = "none")]
pub mod device;
#[cfg(any(target_os = "none", test))]
mod dip;
#[cfg(target_os = "none")]
mod early;
#[cfg(target_os = "none")]
mod edge;
#[cfg(target_os = "none")]
pub mod fitted;
#[cfg(target_os = "none")]
pub mod flash;
#[cfg(target_os = "none")]
mod gap_timer;
#[cfg(all(target_os = "none", feature = "loader"))]
pub mod loading;
#[cfg(target_os = "none")]
mod mem;
#[cfg(target_os = "none")]
mod own_dac;
#[cfg(target_os = "none")]
mod pin_io;
#[cfg(any(target_os = "none", test))]
mod registers;
#[cfg(target_os = "none")]
mod rs485;
#[cfg(target_os = "none")]
mod safe;
#[cfg(target_os = "none")]
mod scan_timer;
#[cfg(target_os = "none")]
mod second_uart;
#[cfg(target_os = "none")]
mod slot;
#[cfg(target_os = "none")]
pub mod stack;
#[cfg(target_os = "none")]
mod unique_id;
#[cfg(target_os = "none")]
mod vectors;
#[cfg(target_os = "none")]
mod wait;
#[cfg(target_os = "none")]
mod watchdog;

#[cfg(target_os = "none")]
pub use {
    adc::Sampler,
    board::RecoveryPins,
    clock::ClockSource,
    crc_unit::CrcUnit,
    flash::{Flash, FlashError},
    gap_timer::Rs485Timer,
    i2c::DacBus,
    own_dac::OwnDac,
    pin_io::IoPin,
    registers::{Part, Registers, Wrong},
    rs485::{Rs485, disable_driver},
    safe::outputs_off,
    scan_timer::ScanTimer,
    second_uart::{Damaged, Proof as SecondProof, RadioIo, SecondOff, SecondUart},
    stm32f1xx_hal::pac,
    watchdog::Watchdog,
};

/// The slot behind the loader that this program is linked for: 0 is A, 1 is B.
pub const SLOT: Option<usize> = if cfg!(feature = "slot-a") {
    Some(0)
} else if cfg!(feature = "slot-b") {
    Some(1)
} else {
    None
};

/// Restarts the device by a software reset, which immediately makes every pin a floating input.
#[cfg(target_os = "none")]
pub fn restart() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}
