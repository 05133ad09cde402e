//! I2C1 for the DACs of the analog-output modules, on PB6 and PB7.
//!
//! A module may be missing, or lose its power during a byte and hold SDA or SCL low indefinitely. Every wait ends
//! after [`I2C_STEP_US`](crate::design::I2C_STEP_US). A transfer of 13 bytes normally takes 1.5 ms, and at most 4
//! ms when every step takes as long as it may. After every error but a missing acknowledge of the address, the
//! peripheral is taken off the bus. The next transfer enables it again and first [recovers](freeing::free) the bus,
//! which takes 0.3 ms, or 2 ms at most. The very first transfer does the same, because a reset of the chip alone
//! may have interrupted a transfer to the DAC.
//!
//! The HAL's driver is not used: it resets the peripheral but recovers no bus, and it keeps the pins. It panics on
//! an empty write or read, and its transactions are `todo!()`.

mod freeing;
#[cfg(target_os = "none")]
mod master;
#[cfg(target_os = "none")]
mod pins;

#[cfg(target_os = "none")]
pub use master::DacBus;
