//! The modio-02: an STM32F103CB, or a C8 on a bare "Blue Pill" with a transceiver. One slot, port 5.

use super::{AddressPins, Descriptor, LinePins, PortKind, RadioPins, SecondPins, SlotPins};
use crate::{
    pin::{Pin, Port},
    usart::Usart,
};

/// The modio-02.
pub const BOARD: Descriptor = Descriptor {
    mapr: 0,
    line: LinePins {
        uart: Usart::Usart1,
        driver: Pin::a(8),
    },
    last_port: Port::C,
    held: &[],
    slots: &[SlotPins {
        lines: [Pin::a(0), Pin::a(1), Pin::a(2), Pin::a(3)],
        kind: PortKind::Slot { dac_address: 0x60 },
    }],
    address: AddressPins::Switch([
        Pin::a(4),
        Pin::a(5),
        Pin::a(6),
        Pin::a(7),
        Pin::b(12),
        Pin::b(13),
        Pin::b(14),
        Pin::b(15),
    ]),
    leds: &[Pin::b(8), Pin::b(9), Pin::c(13)],
    second: Some(SecondPins {
        uart: Usart::Usart3,
        radio: Some(RadioPins {
            mode: [Pin::b(0), Pin::b(1)],
            aux: Pin::b(5),
        }),
    }),
};
