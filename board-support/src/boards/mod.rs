//! The boards. One constant per board says what is connected to which pin. The rest of a board is its row in crate
//! register-map, which the linker script has from there.
//!
//! A cargo feature with the board's name selects the board. [`board`](crate::board) holds what all boards share:
//! the DACs' bus on PB6 and PB7.

mod fx3u;

use crate::{
    gesture::Gesture,
    pin::{Pin, Port},
    usart::Usart,
};

/// Declares a module for each board, and checks its descriptor.
macro_rules! boards {
    ($($board:ident)+) => {
        $(
            pub mod $board;
            const _: () = $board::BOARD.check();
        )+
    };
}

boards! { eth_io5r fx3u_14 fx3u_24 modio_02 modio_08 }

// `BOARD`: the descriptor of the board whose feature is on. Tests without a feature are those of the modio-02.
include!(concat!(env!("OUT_DIR"), "/board.rs"));

/// A board.
#[derive(Clone, Copy, Debug)]
pub struct Descriptor {
    /// AFIO_MAPR, which is written once: remapped pins, and whether the pins of the debug port are free (RM0008 9.4.2).
    pub mapr: u32,
    /// The RS-485 line.
    pub line: LinePins,
    /// The last port with pins that are used. The clocks of the ports from A to this one are on.
    pub last_port: Port,
    /// Pins that are held from the first instructions of loader and application on.
    pub held: &'static [(Pin, Held)],
    /// The slots in the order of their ports. The port numbers are consecutive.
    pub slots: &'static [SlotPins],
    /// What sets the unit address.
    pub address: AddressPins,
    /// The LEDs for activity, fault and running, or only that for running. High lights activity and fault, low lights
    /// running.
    pub leds: &'static [Pin],
    /// The second line.
    pub second: Option<SecondPins>,
}

/// How a pin is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Held {
    /// An output that is low.
    Low,
    /// An output that is high.
    High,
    /// An input with pull-down.
    PulledDown,
}

/// What sets the unit address.
#[derive(Clone, Copy, Debug)]
pub enum AddressPins {
    /// The pins of SW01, position 1 first. A position that is ON connects its pin to ground.
    Switch([Pin; 8]),
    /// Register UNIT. This gesture starts recovery.
    Register(Gesture),
}

/// The UART of the RS-485 line and its pins.
#[derive(Clone, Copy, Debug)]
pub struct LinePins {
    /// The UART, whose pins for TX and RX follow from it.
    pub uart: Usart,
    /// Driver enable of the transceiver: high turns the driver on.
    pub driver: Pin,
}

/// The pins of a port: of a slot, or of fixed inputs or outputs.
#[derive(Clone, Copy, Debug)]
pub struct SlotPins {
    /// Lines 1 to 4. In a slot each is also an input of ADC1. Another port can have fewer: the others are [`Pin::NONE`].
    pub lines: [Pin; 4],
    /// What is connected to them.
    pub kind: PortKind,
}

/// What a port is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PortKind {
    /// A slot for a module.
    Slot {
        /// I2C address of the DAC of an analog-output module in this slot, 0x60 to 0x67, different in each slot.
        dac_address: u8,
    },
    /// Digital inputs, for which a low line counts as 1, as in a 4DI.
    Inputs,
    /// Digital outputs, which a high line turns on, as in a 4DO.
    Outputs,
    /// Analog inputs, as in a 4AI.
    AnalogInputs(&'static FullScale),
    /// Analog outputs by the part's own DAC, as in a 4AO.
    AnalogOutputs(&'static FullScale),
    /// Analog inputs, as in a 4AI; or, as in a 2AI2AO, the first two of them and outputs by the part's own DAC.
    Analog(&'static Analog),
}

/// The converters of a port of kind [`PortKind::Analog`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Analog {
    /// Codes of the inputs.
    pub inputs: FullScale,
    /// The pins of channels 3 and 4 as outputs.
    pub outputs: [Pin; 2],
    /// Codes of the outputs, which are the last two of these.
    pub output: FullScale,
}

/// Codes of the converter at 10 V or 20 mA, for each channel.
pub type FullScale = [u16; 4];

/// The UART of the second line, and what is connected to it.
#[derive(Clone, Copy, Debug)]
pub struct SecondPins {
    /// The UART, whose pins for TX and RX follow from it.
    pub uart: Usart,
    /// Further pins of a LoRa radio. `None` for an RS-232 socket.
    pub radio: Option<RadioPins>,
}

/// The pins of the LoRa radio, besides its UART.
#[derive(Clone, Copy, Debug)]
pub struct RadioPins {
    /// M0 and M1, which select the mode.
    pub mode: [Pin; 2],
    /// AUX, which is low while the radio is busy.
    pub aux: Pin,
}

impl LinePins {
    /// Returns the pin whose edges raise an interrupt: RX, unless a timer captures them.
    #[must_use]
    pub const fn edge(&self) -> Option<Pin> {
        if self.uart.is_captured() {
            None
        } else {
            Some(self.uart.rx())
        }
    }

    /// Returns the bits of the line's pins in a configuration register.
    #[must_use]
    pub const fn mode_bits(&self, register: u32) -> u32 {
        let pins = [self.driver, self.uart.tx(), self.uart.rx()];
        let (mut bits, mut n) = (0, 0);
        while n < pins.len() {
            if pins[n].mode_register() == register {
                bits |= pins[n].mode_bits();
            }
            n += 1;
        }
        bits
    }
}

impl Descriptor {
    /// Returns whether some channels of ports have no pin.
    #[must_use]
    pub const fn lacks_channels(&self) -> bool {
        let mut slot = 0;
        while slot < self.slots.len() {
            let mut line = 0;
            while line < 4 {
                if self.slots[slot].lines[line].is_none() {
                    return true;
                }
                line += 1;
            }
            slot += 1;
        }
        false
    }

    /// Returns whether there are slots, and with them the bus to the DACs of their modules.
    #[must_use]
    pub const fn has_slots(&self) -> bool {
        let mut slot = 0;
        while slot < self.slots.len() {
            if matches!(self.slots[slot].kind, PortKind::Slot { .. }) {
                return true;
            }
            slot += 1;
        }
        false
    }

    /// Returns whether there are analog inputs or outputs, or slots for them.
    #[must_use]
    pub const fn has_analog(&self) -> bool {
        let mut slot = 0;
        while slot < self.slots.len() {
            if !matches!(self.slots[slot].kind, PortKind::Inputs | PortKind::Outputs) {
                return true;
            }
            slot += 1;
        }
        false
    }

    /// Returns whether the part's own DAC is used.
    #[must_use]
    pub const fn has_own_dac(&self) -> bool {
        let mut slot = 0;
        while slot < self.slots.len() {
            if matches!(
                self.slots[slot].kind,
                PortKind::AnalogOutputs(_) | PortKind::Analog(_)
            ) {
                return true;
            }
            slot += 1;
        }
        false
    }

    /// Checks the descriptor at compile time.
    const fn check(&self) {
        assert!(self.slots.len() <= 8, "a board has at most 8 ports");
        assert!(
            matches!(self.leds.len(), 1 | 3),
            "a board has one LED or three"
        );
        let mut slot = 0;
        while slot < self.slots.len() {
            let SlotPins { lines, kind } = self.slots[slot];
            assert!(
                matches!(kind, PortKind::Slot { .. }) == self.has_slots(),
                "a board has slots or fixed ports, not both"
            );
            let mut line = 0;
            while line < 4 {
                let pin = lines[line];
                assert!(
                    match kind {
                        PortKind::Slot { .. } | PortKind::Analog(_) => {
                            pin.adc_input().is_some()
                        }
                        PortKind::AnalogInputs(_) => pin.is_none() || pin.adc_input().is_some(),
                        PortKind::AnalogOutputs(_) => pin.is_none() || pin.dac_output().is_some(),
                        PortKind::Inputs | PortKind::Outputs => true,
                    },
                    "every analog line must be an input or output of a converter"
                );
                line += 1;
            }
            slot += 1;
        }
    }
}

/// Number of LEDs of the board.
#[cfg(target_os = "none")]
pub const LEDS: usize = BOARD.leds.len();

/// Number of slots of the board.
#[cfg(target_os = "none")]
pub const SLOTS: usize = BOARD.slots.len();

#[cfg(test)]
mod tests {
    use register_map::board::Row;

    #[test]
    fn features_of_the_package_are_the_rows_and_what_is_linked() {
        let manifest = include_str!("../../Cargo.toml");
        let (_, features) = manifest.split_once("[features]").unwrap();
        let (features, _) = features.split_once("\n[").unwrap();
        let names = features
            .lines()
            .filter_map(|line| line.strip_suffix(" = []"));
        let boards = Row::ALL.iter().map(|board| board.name);
        assert!(names.eq(boards.chain(["loader", "slot-a", "slot-b"])));
    }
}
