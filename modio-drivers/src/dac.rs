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

use crate::{CHANNELS, DacLink, scale::CODE_MAX};

/// The DAC's address on its bus.
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

/// Brings what a [`DacLink`] wants to the DAC.
#[derive(Debug)]
pub struct DacWorker<I2C> {
    i2c: I2C,
    /// What the DAC has, as far as is known.
    sent: Option<[u16; CHANNELS]>,
    until_refresh: u8,
    /// Failures in a row.
    failures: u8,
    /// Calls to be left out.
    pause: u8,
}

impl<I2C: I2c> DacWorker<I2C> {
    /// Takes over a bus, every one of whose transfers must end within a bounded time.
    pub const fn new(i2c: I2C) -> Self {
        Self {
            i2c,
            sent: None,
            until_refresh: 0,
            failures: 0,
            pause: 0,
        }
    }

    /// The bus, to free it after [`DacError::Bus`].
    pub const fn bus(&mut self) -> &mut I2C {
        &mut self.i2c
    }

    /// To be called every 10 ms, or as soon as codes have been posted as well. Makes one transfer of
    /// 13 bytes, 0.3 ms at 400 kHz, when codes have changed, when it is time to refresh, or when a
    /// failed transfer is to be tried again: at the next call, then after 1, 2, 4, 8 and 16 calls left
    /// out. Returns whether it made one. Before the first post it leaves the DAC alone.
    ///
    /// # Errors
    ///
    /// [`DacError`] when a transfer was tried and failed; from the second in a row on, until one
    /// succeeds, [`DacLink::failed`] says so too.
    pub fn work(&mut self, link: &DacLink) -> Result<bool, DacError> {
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
        let result = self.transfer(wanted);
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

    fn transfer(&mut self, codes: [u16; CHANNELS]) -> Result<(), DacError> {
        let [a, b, c, d] = codes.map(|code| {
            // The crate does not check this: a larger code would reach into the gain bit.
            ChannelState::new()
                .voltage_reference_mode(VoltageReferenceMode::External)
                .value(code.min(CODE_MAX))
        });
        MCP4728::new(&mut self.i2c, DAC_ADDRESS)
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
