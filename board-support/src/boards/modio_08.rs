//! The modio-08: an STM32F103RC. Four slots, ports 1 to 4.

use super::{AddressPins, Descriptor, LinePins, PortKind, RadioPins, SecondPins, SlotPins};
use crate::{
    pin::{Pin, Port},
    usart::Usart,
};

/// The modio-08.
pub const BOARD: Descriptor = Descriptor {
    mapr: 0,
    line: LinePins {
        uart: Usart::Usart1,
        driver: Pin::a(8),
    },
    last_port: Port::C,
    held: &[],
    slots: &[
        SlotPins {
            lines: [Pin::a(0), Pin::a(1), Pin::a(2), Pin::a(3)],
            kind: PortKind::Slot { dac_address: 0x60 },
        },
        SlotPins {
            lines: [Pin::a(4), Pin::a(5), Pin::a(6), Pin::a(7)],
            kind: PortKind::Slot { dac_address: 0x61 },
        },
        SlotPins {
            lines: [Pin::c(0), Pin::c(1), Pin::c(2), Pin::c(3)],
            kind: PortKind::Slot { dac_address: 0x62 },
        },
        SlotPins {
            lines: [Pin::b(0), Pin::b(1), Pin::c(4), Pin::c(5)],
            kind: PortKind::Slot { dac_address: 0x63 },
        },
    ],
    address: AddressPins::Switch([
        Pin::c(6),
        Pin::c(7),
        Pin::c(8),
        Pin::c(9),
        Pin::b(12),
        Pin::b(13),
        Pin::b(14),
        Pin::b(15),
    ]),
    leds: &[Pin::b(8), Pin::b(9), Pin::c(13)],
    second: Some(SecondPins {
        uart: Usart::Usart3,
        radio: Some(RadioPins {
            mode: [Pin::c(10), Pin::c(11)],
            aux: Pin::c(12),
        }),
    }),
};
