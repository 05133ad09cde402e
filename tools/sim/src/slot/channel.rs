//! The state of a channel, and the reason why a change of it is refused.

use core::fmt;

/// Highest voltage at the pin of an analog input, in mV: full scale of the module's circuit.
pub const MAX_MILLIVOLTS: u16 = 3300;

/// State of a channel of the module in a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// The module does not have this channel.
    None,
    /// A digital input.
    Di {
        /// Whether a voltage is applied to the input.
        energised: bool,
    },
    /// A digital output.
    Do {
        /// Whether the transistor of the output conducts.
        on: bool,
    },
    /// A relay.
    Relay {
        /// Whether the coil is energised.
        energised: bool,
        /// Whether the jumper is set to manual.
        manual: bool,
    },
    /// An analog input.
    Ai {
        /// Voltage at the pin, 0 to 3300 mV.
        millivolts: u16,
    },
    /// An analog output.
    Ao {
        /// Output code of the DAC, 0 to 4095.
        code: u16,
    },
}

/// Reason why a change of a channel is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// The module has no such input on this channel.
    Channel,
    /// The voltage is higher than [`MAX_MILLIVOLTS`].
    Millivolts,
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Channel => f.write_str("the plugged module has no such input on this channel"),
            Self::Millivolts => write!(f, "an analog input takes 0 to {MAX_MILLIVOLTS} mV"),
        }
    }
}

impl std::error::Error for Error {}
