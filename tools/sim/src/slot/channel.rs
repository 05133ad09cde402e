//! A channel as it stands, and why the outside cannot apply something to it.

use core::fmt;

/// The highest voltage at an analog input's pin, mV: full scale of the module's conditioning.
pub const MAX_MILLIVOLTS: u16 = 3300;

/// One channel of the plugged module, as it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// No such channel.
    None,
    /// A digital input.
    Di {
        /// Whether the outside energises it.
        energised: bool,
    },
    /// A digital output.
    Do {
        /// Whether its transistor conducts.
        on: bool,
    },
    /// A relay.
    Relay {
        /// Whether its coil is energised.
        energised: bool,
        /// Whether its jumper says manual.
        manual: bool,
    },
    /// An analog input.
    Ai {
        /// The voltage at the pin, 0 to 3300 mV.
        millivolts: u16,
    },
    /// An analog output.
    Ao {
        /// The DAC's output code, 0 to 4095.
        code: u16,
    },
}

/// Why the outside cannot apply that to a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// The plugged module has no such input on that channel.
    Channel,
    /// More than [`MAX_MILLIVOLTS`].
    Millivolts,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Channel => f.write_str("the plugged module has no such input on that channel"),
            Self::Millivolts => write!(f, "an analog input takes 0 to {MAX_MILLIVOLTS} mV"),
        }
    }
}

impl std::error::Error for Error {}
