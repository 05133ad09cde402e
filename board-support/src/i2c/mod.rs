//! I2C1 for the DAC of the analog-output modules, on PB6 and PB7.
//!
//! A module may be missing, or lose its power in the middle of a byte, and hold SDA or SCL for ever.
//! Every wait has an end, after [`I2C_STEP_US`](crate::design::I2C_STEP_US), so that a transfer of 13
//! bytes takes 1.5 ms when all is well and at most 4 when every step takes as long as it may. After
//! anything but a missing acknowledge the peripheral is taken off the bus, and put back by the next
//! transfer, which first [frees](freeing::free) the bus by hand: 0.3 ms, or 2 at most. That it does
//! before the very first one as well: a reset of the chip alone may have left the DAC in the middle of a
//! byte.
//!
//! Own code over the registers, because the HAL's driver cannot be had back from a held bus (its pins
//! are its own, and its reset sends a stop into a peripheral that is not the master), waits ten times
//! for the start condition, panics on an empty write and has `todo!()` for transactions.

mod freeing;
#[cfg(target_os = "none")]
mod master;
#[cfg(target_os = "none")]
mod pins;

#[cfg(target_os = "none")]
pub(crate) use pins::BusPins;
#[cfg(target_os = "none")]
pub use {
    freeing::Held,
    master::{DacBus, DacBusError},
};
