//! The boards with fixed inputs and outputs that people can buy.
//!
//! `fx3u` is the clone of Mitsubishi's FX3U-14MR and FX3U-24MR. Its pins are those of three firmwares
//! (eddyem/stm32samples, `F1:F103/FX3U/hardware.c`; kinsamanka/openplc-stm32-freertos, `src/boards.h`;
//! Chupakabra303/FX_PLC_STM32duino), its circuits those of the schematic of the FX3U-24MR (eddyem/stm32samples,
//! `F1:F103/FX3U/kicad`). The schematic has Y4 at PB0; all three firmwares switch Y4 at PB3, which is used here.
//! The pins of `eth-io5r` are those of kinsamanka's firmware, which has no schematic.

use super::layout::{Led, Leds, LinePins};
use super::terminals::{Kind, Terminal};
use super::{Layout, MODIO_08};
use f103::part::{STM32F103CB, STM32F103VC};
use f103::soc::Pin;
use register_map::Board;

/// Line and LEDs of the fx3u.
const FX3U: Layout = Layout {
    board: &register_map::board::MODIO_08,
    part: STM32F103VC,
    slots: &[],
    terminals: &[],
    switch: &[],
    line: LinePins {
        tx: Pin::new('C', 10),
        enable: Pin::new('A', 14),
        enable_pulled_up: true,
    },
    rs232: Some(Pin::new('A', 9)),
    leds: Leds {
        activity: None,
        fault: None,
        run: Led {
            pin: Pin::new('D', 10),
            lit_by: false,
        },
    },
    // SDA and SCL of the EEPROM, and the receiver of the CAN transceiver, whose bus is idle.
    pulled_up: &[Pin::new('A', 13), Pin::new('A', 15), Pin::new('D', 0)],
    radio: None,
};

/// The clone of the FX3U-14MR.
pub const FX3U_14: Layout = Layout {
    board: row("fx3u-14"),
    terminals: &FX3U_14_TERMINALS,
    ..FX3U
};

/// The clone of the FX3U-24MR.
pub const FX3U_24: Layout = Layout {
    board: row("fx3u-24"),
    terminals: &FX3U_24_TERMINALS,
    ..FX3U
};

/// The board that is sold as "eth_modbus_io5r". Its Ethernet controller is held in reset.
pub const ETH_IO5R: Layout = Layout {
    board: row("eth-io5r"),
    part: STM32F103CB,
    terminals: &ETH_IO5R_TERMINALS,
    line: LinePins {
        tx: Pin::new('A', 2),
        enable: Pin::new('A', 1),
        enable_pulled_up: false,
    },
    rs232: None,
    leds: Leds {
        activity: None,
        fault: None,
        run: Led {
            pin: Pin::new('A', 8),
            lit_by: false,
        },
    },
    pulled_up: &[],
    ..FX3U
};

/// Returns the row of the register map; until it has one, that of the board with the same flash.
const fn row(name: &str) -> &'static Board {
    match Board::named(name) {
        Some(row) => row,
        None => MODIO_08.board,
    }
}

const fn terminal(name: &'static str, kind: Kind, port: char, number: usize) -> Terminal {
    Terminal {
        name,
        pin: Pin::new(port, number),
        kind,
    }
}

/// The terminals of both types.
const FX3U_14_TERMINALS: [Terminal; 26] = {
    use Kind::{Current, Input, Output, Potentiometer, Relay, Supply, Switch, Voltage};
    [
        terminal("X0", Input, 'B', 13),
        terminal("X1", Input, 'B', 14),
        terminal("X2", Input, 'B', 11),
        terminal("X3", Input, 'B', 12),
        terminal("X4", Input, 'E', 15),
        terminal("X5", Input, 'B', 10),
        terminal("X6", Input, 'E', 13),
        terminal("X7", Input, 'E', 14),
        terminal("Y0", Relay, 'C', 9),
        terminal("Y1", Relay, 'C', 8),
        terminal("Y2", Relay, 'A', 8),
        terminal("Y3", Relay, 'A', 0),
        terminal("Y4", Relay, 'B', 3),
        terminal("Y5", Relay, 'D', 12),
        terminal("AD0", Voltage, 'A', 1),
        terminal("AD1", Voltage, 'A', 3),
        terminal("AD2", Voltage, 'C', 4),
        terminal("AD3", Current, 'C', 5),
        terminal("AD4", Current, 'C', 0),
        terminal("AD5", Current, 'C', 1),
        terminal("POT0", Potentiometer, 'C', 2),
        terminal("POT1", Potentiometer, 'C', 3),
        terminal("DA0", Output, 'A', 4),
        terminal("DA1", Output, 'A', 5),
        terminal("RUN", Switch, 'B', 2),
        terminal("24V", Supply, 'C', 7),
    ]
};

/// The terminals of the FX3U-24MR beyond those of the FX3U-14MR.
const MORE: [Terminal; 10] = {
    use Kind::{Input, Relay};
    [
        terminal("X10", Input, 'E', 11),
        terminal("X11", Input, 'E', 12),
        terminal("X12", Input, 'E', 9),
        terminal("X13", Input, 'E', 10),
        terminal("X14", Input, 'E', 7),
        terminal("X15", Input, 'E', 8),
        terminal("Y6", Relay, 'B', 15),
        terminal("Y7", Relay, 'A', 7),
        terminal("Y10", Relay, 'A', 6),
        terminal("Y11", Relay, 'A', 2),
    ]
};

/// The terminals of the FX3U-24MR, in the order on the board: X, Y, then the others.
const FX3U_24_TERMINALS: [Terminal; 36] = {
    let (few, more) = (FX3U_14_TERMINALS, MORE);
    let mut all = [few[0]; 36];
    let mut n = 0;
    while n < all.len() {
        all[n] = match n {
            0..8 => few[n],
            8..14 => more[n - 8],
            14..20 => few[n - 6],
            20..24 => more[n - 14],
            _ => few[n - 10],
        };
        n += 1;
    }
    all
};

const ETH_IO5R_TERMINALS: [Terminal; 11] = {
    use Kind::{Input, Relay};
    [
        terminal("I0", Input, 'B', 1),
        terminal("I1", Input, 'B', 12),
        terminal("I2", Input, 'B', 13),
        terminal("I3", Input, 'B', 14),
        terminal("I4", Input, 'B', 15),
        terminal("BUTTON", Input, 'B', 8),
        terminal("Q0", Relay, 'B', 5),
        terminal("Q1", Relay, 'B', 6),
        terminal("Q2", Relay, 'B', 7),
        terminal("Q3", Relay, 'B', 10),
        terminal("Q4", Relay, 'B', 11),
    ]
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_terminals_have_the_same_name_or_pin() {
        for layout in [&FX3U_14, &FX3U_24, &ETH_IO5R] {
            let all = layout.terminals;
            for (n, one) in all.iter().enumerate() {
                let mut others = all[..n].iter();
                assert!(
                    others.all(|other| other.name != one.name && other.pin != one.pin),
                    "{}",
                    one.name
                );
                assert_ne!(one.pin, layout.line.tx);
                assert_ne!(one.pin, layout.line.enable);
            }
        }
        let names: Vec<_> = FX3U_24.terminals.iter().map(|one| one.name).collect();
        assert_eq!(names[7..11], ["X7", "X10", "X11", "X12"]);
        assert_eq!(names[19..25], ["Y5", "Y6", "Y7", "Y10", "Y11", "AD0"]);
    }
}
