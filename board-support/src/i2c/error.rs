//! Errors of the DACs' bus.

use embedded_hal::i2c::{Error, ErrorKind, NoAcknowledgeSource};

use super::freeing::Held;

/// Error of a transfer. Every transfer may be tried again; the driver recovers the bus before the next one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DacBusError {
    /// No device acknowledged the address, or the slave did not acknowledge a byte.
    NoAcknowledge(NoAcknowledgeSource),
    /// The bus did not follow what was driven, as if there were a second master.
    ArbitrationLost,
    /// An unexpected start or stop condition: a disturbance.
    Misplaced,
    /// A step took too long: a device stretched or held the clock.
    Timeout,
    /// A device holds a wire low, and clocking the bus did not release it.
    Held(Held),
    /// The transaction contains a read, which is not supported.
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
