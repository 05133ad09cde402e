//! The "eth_modbus_io5r": an STM32F103CB with five isolated inputs, a button and five relays.
//!
//! The pins are those of kinsamanka/openplc-stm32-freertos, `src/boards.h` and `src/hw.c` (BOARD_ETH_MODBUS_IO5R). A
//! later file of the same author, `src/hw.h` of kinsamanka/openplc-uploader, agrees but for the driver enable: PA10.

use super::{AddressPins, Descriptor, Held, LinePins, PortKind, SlotPins};
use crate::{
    gesture::Gesture,
    pin::{Pin, Port},
    usart::Usart,
};

/// The button.
const BUTTON: Pin = Pin::b(8);

/// The eth-io5r.
pub const BOARD: Descriptor = Descriptor {
    mapr: 0,
    line: LinePins {
        uart: Usart::Usart2,
        driver: Pin::a(1),
    },
    last_port: Port::B,
    held: &[
        // The W5500: it has power and is held in reset, and its chip select is high.
        (Pin::a(0), Held::Low),
        (Pin::b(9), Held::High),
        (Pin::a(4), Held::High),
        // If the driver enable is here and not at PA1, the transceiver must receive. The pin is no output, because it
        // is RX of USART1, which another device may drive.
        (Pin::a(10), Held::PulledDown),
    ],
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pa10_is_pulled_down_and_has_no_other_use() {
        let pin = Pin::a(10);
        assert!(BOARD.held.contains(&(pin, Held::PulledDown)));
        let uart = BOARD.line.uart;
        let line = [BOARD.line.driver, uart.tx(), uart.rx()];
        let slots = BOARD.slots.iter().flat_map(|slot| slot.lines);
        let mut used = slots.chain(line).chain(BOARD.leds.iter().copied());
        assert!(used.all(|used| used != pin));
    }
}
