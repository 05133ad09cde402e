//! The errors of chips and boards.

use core::fmt;

/// Reason why a chip or a board refuses a call.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// The image or the contents of the flash do not fit this part, for this reason.
    Image(String),
    /// The call is only possible while the power is off.
    Powered,
    /// The channel does not exist or is of another kind.
    Channel,
    /// The board has no slot at this port.
    Slot(u8),
    /// The board has no LoRa module.
    NoRadio,
    /// A value is out of this range.
    Range(&'static str),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Image(text) => f.write_str(text),
            Self::Powered => f.write_str("this is only possible while the power is off"),
            Self::Channel => f.write_str("the plugged module has no such input on this channel"),
            Self::Slot(port) => write!(f, "the board has no slot at port {port}"),
            Self::NoRadio => f.write_str("the board has no LoRa module"),
            Self::Range(text) => write!(f, "out of range: {text}"),
        }
    }
}

impl std::error::Error for Error {}
