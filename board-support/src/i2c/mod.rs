//! I2C1 for the DACs of the analog-output modules, on PB6 and PB7.
//!
//! A module may be missing, or lose its power during a byte and hold SDA or SCL low indefinitely. Every wait ends
//! after [`I2C_STEP_US`](crate::design::I2C_STEP_US). A transfer of 13 bytes at 300 kHz takes 0.4 ms. It takes less than
//! 4 ms when each of its steps takes as long as it may. After every error except a missing acknowledge of the address,
//! the driver resets the peripheral, which frees the wires. The next transfer enables the peripheral again and first
//! [recovers](freeing::free) the bus: within 0.2 ms when no slave stretches the clock, and within 2.1 ms always. The
//! first transfer after a start does the same, because a reset of the part alone may have interrupted a transfer.
//!
//! docs/decisions.md says why the bus is polled and only transmits, and why the HAL's driver is not used.

mod freeing;
#[cfg(target_os = "none")]
mod master;
#[cfg(target_os = "none")]
mod pins;

#[cfg(target_os = "none")]
pub use master::DacBus;
