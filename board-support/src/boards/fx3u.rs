//! What the clones of Mitsubishi's FX3U-14MR and FX3U-24MR have in common: an STM32F103VC.
//!
//! The pins are those on which three sources agree: eddyem/stm32samples, `F1:F103/FX3U/` (with a schematic of the -24MR),
//! kinsamanka/openplc-stm32-freertos, `src/boards.h` (BOARD_FX3U), and Chupakabra303/FX_PLC_STM32duino.

use super::{AddressPins, Descriptor, FullScale, Held, LinePins, PortKind, SecondPins, SlotPins};
use crate::{
    gesture::Gesture,
    pin::{Pin, Port},
    usart::Usart,
};

/// The RUN switch. Its pin is BOOT1, so it must never be an output.
pub(super) const RUN: Pin = Pin::b(2);

/// Driver enable of the RS-485 transceiver, which the board pulls up.
const DRIVER: Pin = Pin::a(14);

/// The line must stay idle while no UART drives it.
const HELD: [(Pin, Held); 2] = [(DRIVER, Held::Low), (Usart::Uart4.tx(), Held::High)];

const LEDS: [Pin; 1] = [Pin::d(10)];

/// Inputs AD0 to AD2: 10 V through 10 kOhm and 4.7 kOhm (4.7 / 14.7) is 3.197 V.
const VOLTS: u16 = 3968;
/// Inputs AD3 to AD5: 20 mA through 499 Ohm beside the same divider is 3.086 V.
const MILLIAMPS: u16 = 3830;
/// The potentiometers, between ground and 3.3 V.
const ALL: u16 = 4095;
/// Outputs DA0 and DA1: 10 V after an amplification of 3.13 is 3.195 V.
const AMPLIFIED: u16 = 3965;

/// AD0 to AD3.
pub(super) const VOLTAGES: FullScale = [VOLTS, VOLTS, VOLTS, MILLIAMPS];
pub(super) const VOLTAGE_PINS: [Pin; 4] = [Pin::a(1), Pin::a(3), Pin::c(4), Pin::c(5)];
/// AD4, AD5 and the potentiometers.
pub(super) const OTHERS: SlotPins = SlotPins {
    lines: [Pin::c(0), Pin::c(1), Pin::c(2), Pin::c(3)],
    kind: PortKind::AnalogInputs(&[MILLIAMPS, MILLIAMPS, ALL, ALL]),
};
/// DA0 and DA1.
pub(super) const OUTPUT_PINS: [Pin; 2] = [Pin::a(4), Pin::a(5)];
pub(super) const OUTPUTS: FullScale = [AMPLIFIED; 4];

/// X0 to X3.
pub(super) const X0: SlotPins = inputs([Pin::b(13), Pin::b(14), Pin::b(11), Pin::b(12)]);
/// X4 to X7.
pub(super) const X4: SlotPins = inputs([Pin::e(15), Pin::b(10), Pin::e(13), Pin::e(14)]);
/// Y0 to Y3.
pub(super) const Y0: SlotPins = outputs([Pin::c(9), Pin::c(8), Pin::a(8), Pin::a(0)]);
/// Y4 and Y5.
pub(super) const Y4: [Pin; 2] = [Pin::b(3), Pin::d(12)];

pub(super) const fn inputs(lines: [Pin; 4]) -> SlotPins {
    SlotPins {
        lines,
        kind: PortKind::Inputs,
    }
}

pub(super) const fn outputs(lines: [Pin; 4]) -> SlotPins {
    SlotPins {
        lines,
        kind: PortKind::Outputs,
    }
}

/// Returns the board with these ports.
pub(super) const fn board(slots: &'static [SlotPins]) -> Descriptor {
    Descriptor {
        // SWJ_CFG = 100: no debug port, because PA14 and PB3 are its pins.
        mapr: 0b100 << 24,
        line: LinePins {
            uart: Usart::Uart4,
            driver: DRIVER,
        },
        last_port: Port::E,
        held: &HELD,
        slots,
        address: AddressPins::Register(Gesture::Moved(RUN)),
        leds: &LEDS,
        second: Some(SecondPins {
            uart: Usart::Usart1,
            radio: None,
        }),
    }
}
