//! The state of a channel.

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
