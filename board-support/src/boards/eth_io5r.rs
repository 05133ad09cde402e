//! The "eth_modbus_io5r": an STM32F103CB with five isolated inputs, a button and five relays.
//!
//! The pins are those of kinsamanka/openplc-stm32-freertos, `src/boards.h` and `src/hw.c` (BOARD_ETH_MODBUS_IO5R).

use super::{AddressPins, Descriptor, LinePins, PortKind, SlotPins};
use crate::{
    gesture::Gesture,
    pin::{Pin, Port},
    usart::Usart,
};

/// The button.
const BUTTON: Pin = Pin::b(8);

/// The eth-io5r.
pub const BOARD: Descriptor = Descriptor {
    name: "eth-io5r",
    mapr: 0,
    line: LinePins {
        uart: Usart::Usart2,
        driver: Pin::a(1),
    },
    last_port: Port::B,
    // The W5500: it has power and is held in reset, and its chip select is high.
    held: &[(Pin::a(0), false), (Pin::b(9), true), (Pin::a(4), true)],
    slots: &[
        // Inputs I0 to I3.
        SlotPins {
            lines: [Pin::b(1), Pin::b(12), Pin::b(13), Pin::b(14)],
            kind: PortKind::Inputs,
        },
        // Input I4 and the button.
        SlotPins {
            lines: [Pin::b(15), BUTTON, Pin::NONE, Pin::NONE],
            kind: PortKind::Inputs,
        },
        // Relays Q0 to Q3.
        SlotPins {
            lines: [Pin::b(5), Pin::b(6), Pin::b(7), Pin::b(10)],
            kind: PortKind::Outputs,
        },
        // Relay Q4.
        SlotPins {
            lines: [Pin::b(11), Pin::NONE, Pin::NONE, Pin::NONE],
            kind: PortKind::Outputs,
        },
    ],
    address: AddressPins::Register(Gesture::Held(BUTTON)),
    leds: &[Pin::a(8)],
    second: None,
};
