//! The errors of boards.

use core::fmt;

/// Reason why a board refuses a call.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// The part refuses it.
    Part(f103::Error),
    /// The channel does not exist or is of another kind.
    Channel,
    /// The board has no slot at this port.
    Slot(u8),
    /// The board has no LoRa module.
    NoRadio,
    /// A value is out of this range.
    Range(&'static str),
}

impl From<f103::Error> for Error {
    fn from(error: f103::Error) -> Self {
        Self::Part(error)
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Part(error) => error.fmt(f),
            Self::Channel => f.write_str("the plugged module has no such input on this channel"),
            Self::Slot(port) => write!(f, "the board has no slot at port {port}"),
            Self::NoRadio => f.write_str("the board has no LoRa module"),
            Self::Range(text) => write!(f, "out of range: {text}"),
        }
    }
}

impl std::error::Error for Error {}
