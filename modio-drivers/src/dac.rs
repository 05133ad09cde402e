//! The slow part of the analog outputs: an MCP4728 quad 12-bit DAC on an I2C bus, which may be missing or stuck. A
//! background task runs it; the scan never waits for it.
//!
//! The only command used is Multi-Write (DS22187E, 5.6.2) for all four channels:
//!
//! ```text
//! 0 1 0 0 0 ch ch UDAC | Vref PD PD Gx d11-d8 | d7-d0    times four, 12 bytes
//! ```
//!
//! Besides the code it contains the reference (VDD), the gain (1) and the power-down bits (normal). After one
//! transfer the DAC is therefore configured correctly, whatever its EEPROM contains. With UDAC = 0 each channel
//! changes its output at its last byte, whatever the level of the LDAC pin. The command only writes the volatile
//! registers. The EEPROM, which would wear out, is never written.

use embedded_hal::i2c::{Error as _, ErrorKind, I2c};

use crate::{CHANNELS, Code, ModuleError};

/// The command and UDAC = 0.
const MULTI_WRITE: u8 = 0b0100_0000;

/// Number of calls between transfers when nothing has changed: 100 ms at one call every 10 ms. Within that time a
/// DAC that has lost its power is detected, or set again when its power has returned.
const REFRESH_CALLS: u8 = 10;

/// Number of failures in a row after which the DAC counts as failed. A single failure may be noise on the bus.
const FAILURES_TO_FAIL: u8 = 2;

/// Largest number of calls to skip after a failure: 160 ms at one call every 10 ms. Time-outs on a stuck bus then
/// take little of the background's time, and a DAC that works again is soon detected.
const PAUSE_MAX_CALLS: u8 = 16;

/// What a module's driver and the worker of its DAC exchange. The scan and the background task share it under
/// a lock.
#[derive(Clone, Copy, Debug, Default)]
pub struct DacLink {
    /// Codes for the channels A to D; `None` before the first scan.
    pub wanted: Option<[Code; CHANNELS]>,
    /// The DAC does not answer, or its bus is stuck.
    pub failed: bool,
}

impl DacLink {
    /// Sets the codes. Returns an error for these channels, channel 1 in bit 0, while they do not reach the DAC.
    pub(crate) const fn drive(
        &mut self,
        wanted: [Code; CHANNELS],
        channels: u8,
    ) -> Result<(), ModuleError> {
        self.wanted = Some(wanted);
        if self.failed {
            Err(ModuleError::chip(channels))
        } else {
            Ok(())
        }
    }
}

/// Transfers codes to one DAC. Several workers with different addresses may share a bus.
#[derive(Debug)]
pub struct DacWorker {
    /// The DAC's address on its bus, 7 bits.
    address: u8,
    /// The codes in the DAC, if they are known.
    sent: Option<[Code; CHANNELS]>,
    until_refresh: u8,
    /// Number of failures in a row.
    failures: u8,
    /// Number of calls to skip.
    pause: u8,
}

impl DacWorker {
    /// Creates a worker for the DAC at this address, 0x60 to 0x67. Most DACs have 0x60 (DS22187E, 5.3).
    #[must_use]
    pub const fn new(address: u8) -> Self {
        Self {
            address,
            sent: None,
            until_refresh: 0,
            failures: 0,
            pause: 0,
        }
    }

    /// Transfers codes if needed. Call this every 10 ms, and also as soon as the codes have changed. It makes one
    /// transfer of 13 bytes, 0.3 ms at 400 kHz, when codes have changed, when a refresh is due, or to repeat a
    /// failed transfer. A failed transfer is repeated at the next call, and after more failures once 1, 2, 4, 8 and
    /// then 16 calls have been skipped. Returns whether a transfer was made. Without codes the DAC is not accessed. Every
    /// transfer of the bus must end within a bounded time.
    ///
    /// # Errors
    ///
    /// The kind of the error when a transfer failed. After any other than [`ErrorKind::NoAcknowledge`] the bus may be
    /// held or disturbed, and must be recovered before the next call: clock SCL until SDA is released, and reset the
    /// peripheral.
    pub fn work(
        &mut self,
        bus: &mut impl I2c,
        wanted: Option<[Code; CHANNELS]>,
    ) -> Result<bool, ErrorKind> {
        if self.pause > 0 {
            self.pause -= 1;
            return Ok(false);
        }
        let Some(wanted) = wanted else {
            return Ok(false);
        };
        self.until_refresh = self.until_refresh.saturating_sub(1);
        if self.sent == Some(wanted) && self.until_refresh > 0 {
            return Ok(false);
        }
        let result = self.transfer(bus, wanted);
        if result.is_ok() {
            self.sent = Some(wanted);
            self.until_refresh = REFRESH_CALLS;
            self.failures = 0;
        } else {
            self.sent = None;
            self.failures = self.failures.saturating_add(1);
            self.pause = pause_after(self.failures);
        }
        result.map(|()| true)
    }

    /// Returns whether the DAC does not answer or its bus is stuck: from the second failure in a row until the next
    /// success.
    #[must_use]
    pub const fn failed(&self) -> bool {
        self.failures >= FAILURES_TO_FAIL
    }

    fn transfer(&self, bus: &mut impl I2c, codes: [Code; CHANNELS]) -> Result<(), ErrorKind> {
        let mut bytes = [[0; 3]; CHANNELS];
        for ((channel, code), bytes) in (0..).zip(codes).zip(&mut bytes) {
            let [high, low] = code.get().to_be_bytes();
            *bytes = [MULTI_WRITE | channel << 1, high, low];
        }
        bus.write(self.address, bytes.as_flattened())
            .map_err(|error| error.kind())
    }
}

/// Returns the number of calls to skip after this many failures: 0, 1, 2, 4, 8, 16, 16 and so on.
fn pause_after(failures: u8) -> u8 {
    match failures.checked_sub(2) {
        Some(doublings) => PAUSE_MAX_CALLS.min(1 << doublings.min(7)),
        None => 0,
    }
}

#[cfg(test)]
mod tests;
