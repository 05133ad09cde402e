//! I2C1 for the DAC of the analog-output modules, on PB6 and PB7.
//!
//! A module may be missing, or lose its power in the middle of a byte, and hold SDA or SCL for ever.
//! Every wait has an end, after [`I2C_STEP_US`](crate::design::I2C_STEP_US), so that a transfer of 13
//! bytes takes 1.5 ms when all is well and at most 4 when every step takes as long as it may. After
//! anything but a missing acknowledge of the address the peripheral is taken off the bus, and put back
//! by the next transfer, which first [frees](freeing::free) the bus by hand: 0.3 ms, or 2 at most. That
//! it does before the very first one as well: a reset of the chip alone may have left the DAC in the
//! middle of a byte.
//!
//! Own code over the registers, because the HAL's driver resets itself but frees no bus, whose pins it
//! keeps; it panics on an empty write or read, and its transactions are `todo!()`.

#[cfg(target_os = "none")]
mod error;
mod freeing;
#[cfg(target_os = "none")]
mod master;
#[cfg(target_os = "none")]
mod pins;

#[cfg(target_os = "none")]
pub(crate) use pins::BusPins;
#[cfg(target_os = "none")]
pub use {error::DacBusError, freeing::Held, master::DacBus};
