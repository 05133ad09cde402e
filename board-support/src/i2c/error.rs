//! What can go wrong on the DAC's bus.

use embedded_hal::i2c::{Error, ErrorKind, NoAcknowledgeSource};

use super::freeing::Held;

/// Why a transfer failed. All may be tried again; the bus is set right by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DacBusError {
    /// Nobody acknowledged the address, or the slave did not take a byte.
    NoAcknowledge(NoAcknowledgeSource),
    /// The bus did not go where it was driven, as if there were another master.
    ArbitrationLost,
    /// A start or stop condition where none should be: a disturbance.
    Misplaced,
    /// A step took too long; the clock was stretched or held.
    Timeout,
    /// Somebody holds a wire low and could not be brought to let go.
    Held(Held),
    /// A transaction that reads: not supported.
    Reads,
}

impl Error for DacBusError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::NoAcknowledge(source) => ErrorKind::NoAcknowledge(*source),
            Self::ArbitrationLost => ErrorKind::ArbitrationLoss,
            Self::Misplaced | Self::Held(_) => ErrorKind::Bus,
            Self::Timeout | Self::Reads => ErrorKind::Other,
        }
    }
}
