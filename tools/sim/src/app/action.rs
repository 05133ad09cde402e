//! Actions of a person or a scenario on a board.

use register_map::Module;
use utoipa::ToSchema;

use super::faults::Faults;
use super::terminals::Applied;

/// An action on a board.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Changes what is connected to a channel.
    Channel {
        /// Port of the slot; `None` means the first slot.
        port: Option<u8>,
        /// Number of the channel, 1 to 4.
        channel: usize,
        /// The change.
        change: Change,
    },
    /// Applies a value to a terminal of a board with fixed inputs and outputs.
    Terminal {
        /// Name of the terminal.
        name: String,
        /// What is applied.
        applied: Applied,
    },
    /// Moves the DIP switch.
    Dip(u8),
    /// Switches the power on.
    PowerOn,
    /// Switches the power off.
    PowerOff,
    /// Plugs in a module; the power must be off.
    Module {
        /// Port of the slot; `None` means the first slot.
        port: Option<u8>,
        /// The module.
        module: Module,
    },
    /// Sets or clears faults.
    Faults(Faults),
}

/// A change of what is connected to a channel.
#[derive(Clone, Copy, Debug, PartialEq, ToSchema)]
#[schema(rename_all = "snake_case")]
pub enum Change {
    /// Applies a voltage to a digital input, or removes it.
    Energised(bool),
    /// Sets the jumper of a relay to manual or to automatic.
    Manual(bool),
    /// Sets the voltage at the pin of an analog input, 0 to 3300 mV.
    Millivolts(u16),
}
