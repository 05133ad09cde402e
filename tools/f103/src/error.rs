//! The errors of chips.

use core::fmt;

/// Reason why a chip refuses a call.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// The image or the contents of the flash do not fit this part, for this reason.
    Image(String),
    /// The call is only possible while the power is off.
    Powered,
    /// A value is out of this range.
    Range(&'static str),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Image(text) => f.write_str(text),
            Self::Powered => f.write_str("this is only possible while the power is off"),
            Self::Range(text) => write!(f, "out of range: {text}"),
        }
    }
}

impl std::error::Error for Error {}
