//! The slow part of the analog outputs: an MCP4728 quad 12-bit DAC on an I2C bus, which may be absent
//! or stuck. A background task runs it; the scan never waits for it.
//!
//! The one command used is Multi-Write (DS22187E, 5.6.2) for all four channels:
//!
//! ```text
//! 0 1 0 0 0 ch ch UDAC | Vref PD PD Gx d11-d8 | d7-d0    times four, 12 bytes
//! ```
//!
//! It carries the reference (VDD), the gain (1) and the power-down bits (normal) beside the code, so
//! after a single transfer a DAC is right whatever its EEPROM had set, and UDAC = 0 puts each channel
//! out at its last byte, wherever the LDAC pin is. It writes the volatile registers alone: the EEPROM,
//! which would wear out, is never written.

use embedded_hal::i2c::{ErrorKind, I2c, NoAcknowledgeSource};
use mcp4728::{Channel, ChannelState, Error, MCP4728, OutputEnableMode, VoltageReferenceMode};

use crate::{CHANNELS, Code, DacLink};

/// The lowest address that a DAC can be ordered with, and the most usual one (DS22187E, 5.3); the highest is 0x67.
pub const DAC_ADDRESS: u8 = 0x60;

/// Calls from one transfer to the next when nothing has changed: 100 ms at a call every 10 ms. By
/// then a DAC that has lost its power is found missing, or set right when it is back.
const REFRESH_CALLS: u8 = 10;

/// Failures in a row after which the link counts as failed: a single one may be noise on the bus.
const FAILURES_TO_FAIL: u8 = 2;

/// Calls left out after a failure at most: 160 ms at a call every 10 ms, so that time-outs on a stuck
/// bus take little of the background's time, and a DAC that comes back is soon found.
const PAUSE_MAX_CALLS: u8 = 16;

/// A transfer failed. It will be made again by itself; the variants are what the caller can do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DacError {
    /// Nobody answered: the module or its power is missing. There is nothing to do but to go on.
    NotAnswering(NoAcknowledgeSource),
    /// The bus is held, disturbed or timed out: free it before the next call, by clocking SCL until
    /// SDA is let go and resetting the peripheral.
    Bus(ErrorKind),
}

impl DacError {
    fn sort(error: &Error<impl embedded_hal::i2c::Error>) -> Self {
        match error {
            Error::I2CError(error) => match error.kind() {
                ErrorKind::NoAcknowledge(source) => Self::NotAnswering(source),
                kind @ (ErrorKind::Bus
                | ErrorKind::ArbitrationLoss
                | ErrorKind::Overrun
                | ErrorKind::Other) => Self::Bus(kind),
                // The enum may grow; a bus of which nothing is known is worth a reset.
                kind => Self::Bus(kind),
            },
            // Checks of the crate that four channels with 12-bit codes always pass.
            Error::ValueOutOfBounds(_)
            | Error::WriteSizeExceeded
            | Error::StartingChannelMismatch => Self::Bus(ErrorKind::Other),
        }
    }
}

/// Brings what a [`DacLink`] wants to one DAC. Several of them, with an address each, may share a bus.
#[derive(Debug)]
pub struct DacWorker {
    /// The DAC's address on its bus, 7 bits.
    address: u8,
    /// What the DAC has, as far as is known.
    sent: Option<[Code; CHANNELS]>,
    until_refresh: u8,
    /// Failures in a row.
    failures: u8,
    /// Calls to be left out.
    pause: u8,
}

impl DacWorker {
    /// For the DAC at this address, 0x60 to 0x67.
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

    /// To be called every 10 ms, or as soon as codes have been posted as well. Makes one transfer of
    /// 13 bytes, 0.3 ms at 400 kHz, when codes have changed, when it is time to refresh, or when a
    /// failed transfer is to be tried again: at the next call, then after 1, 2, 4, 8 and 16 calls left
    /// out. Returns whether it made one. Before the first post it leaves the DAC alone. Every transfer of the bus must end
    /// within a bounded time.
    ///
    /// # Errors
    ///
    /// [`DacError`] when a transfer was tried and failed; from the second in a row on, until one
    /// succeeds, [`DacLink::failed`] says so too.
    pub fn work(&mut self, bus: &mut impl I2c, link: &DacLink) -> Result<bool, DacError> {
        if self.pause > 0 {
            self.pause -= 1;
            return Ok(false);
        }
        let Some(wanted) = link.wanted() else {
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
        link.set_failed(self.failures >= FAILURES_TO_FAIL);
        result.map(|()| true)
    }

    fn transfer(&self, bus: &mut impl I2c, codes: [Code; CHANNELS]) -> Result<(), DacError> {
        let [a, b, c, d] = codes.map(|code| {
            // A larger code would reach into the gain bit: the crate does not check.
            ChannelState::new()
                .voltage_reference_mode(VoltageReferenceMode::External)
                .value(code.get())
        });
        MCP4728::new(bus, self.address)
            .multi_write(&[
                (Channel::A, OutputEnableMode::Update, a),
                (Channel::B, OutputEnableMode::Update, b),
                (Channel::C, OutputEnableMode::Update, c),
                (Channel::D, OutputEnableMode::Update, d),
            ])
            .map_err(|error| DacError::sort(&error))
    }
}

/// The calls to leave out after so many failures: 0, 1, 2, 4, 8, 16, 16 and so on.
fn pause_after(failures: u8) -> u8 {
    match failures.checked_sub(2) {
        Some(doublings) => 1_u8
            .checked_shl(doublings.into())
            .map_or(PAUSE_MAX_CALLS, |pause| pause.clamp(1, PAUSE_MAX_CALLS)),
        None => 0,
    }
}

#[cfg(test)]
mod tests;
