//! Actions of a person or a scenario on a board.

use register_map::Module;

use super::faults::Faults;

/// An action on a board.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Changes the outside world of a channel.
    Channel {
        /// The port of its slot; the first slot without it.
        port: Option<u8>,
        /// Its number, 1 to 4.
        channel: usize,
        /// The change.
        change: Change,
    },
    /// Moves the DIP switch.
    Dip(u8),
    /// Switches the power on.
    PowerOn,
    /// Switches the power off.
    PowerOff,
    /// Plugs in a module; the power must be off.
    Module {
        /// The port of its slot; the first slot without it.
        port: Option<u8>,
        /// The module.
        module: Module,
    },
    /// Sets or clears faults.
    Faults(Faults),
}

/// A change of the outside world of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// Energises a digital input or not.
    Energised(bool),
    /// Sets the jumper of a relay to manual or not.
    Manual(bool),
    /// Sets the voltage at the pin of an analog input, 0 to 3300 mV.
    Millivolts(u16),
}
