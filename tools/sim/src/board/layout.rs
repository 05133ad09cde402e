//! The types of boards: their parts, slots and pins.

use register_map::{Row, board};

use crate::board::terminals::Terminal;
use crate::board::{ETH_IO5R, FX3U_14, FX3U_24};
use crate::slot::mcp4728;
use f103::part::{Part, STM32F103CB, STM32F103RC};
use f103::soc::Pin;

use super::RadioPins;

/// A slot of a board.
#[derive(Clone, Copy, Debug)]
pub struct SlotPins {
    /// Number of the port.
    pub port: u8,
    /// Pins of lines 1 to 4.
    pub lines: [Pin; 4],
    /// I2C address (7 bits) of the DAC of a module in this slot.
    pub dac_address: u8,
}

/// Pins of the RS-485 line.
#[derive(Clone, Copy, Debug)]
pub struct LinePins {
    /// Transmitter of the USART.
    pub tx: Pin,
    /// Driver enable, high = on; the receiver is off then.
    pub enable: Pin,
    /// Whether the board pulls the driver enable up, so that a pin that nothing drives switches the driver on.
    pub enable_pulled_up: bool,
}

/// An LED at a pin.
#[derive(Clone, Copy, Debug)]
pub struct Led {
    /// The pin.
    pub pin: Pin,
    /// Level of the pin that lights the LED.
    pub lit_by: bool,
}

/// The LEDs of a board.
#[derive(Clone, Copy, Debug)]
pub struct Leds {
    /// Line activity.
    pub activity: Option<Led>,
    /// Fault.
    pub fault: Option<Led>,
    /// Running.
    pub run: Led,
}

/// A type of board. I2C1 (PB6, PB7) and the UART of the LoRa module (PB10, PB11) are the same on all boards that have
/// slots.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// The board in the register map: its name, its ports, and the pages in which the configuration is stored.
    pub board: &'static Row,
    /// The microcontroller.
    pub part: Part,
    /// The slots. Methods without a port number mean the first one.
    pub slots: &'static [SlotPins],
    /// The inputs and outputs that are fixed on the board, in their order there.
    pub terminals: &'static [Terminal],
    /// Pins of DIP switch SW01, position 1 first. ON = low.
    pub switch: &'static [Pin],
    /// The RS-485 line.
    pub line: LinePins,
    /// Transmitter of the USART of the RS-232 port.
    pub rs232: Option<Pin>,
    /// The LEDs.
    pub leds: Leds,
    /// Other pins that the board pulls up.
    pub pulled_up: &'static [Pin],
    /// Pins of the LoRa module. M0 and M1 are on the same port.
    pub radio: Option<RadioPins>,
}

/// What both modio boards have alike.
const MODIO: Layout = Layout {
    board: &board::MODIO_02,
    part: STM32F103CB,
    slots: &[],
    terminals: &[],
    switch: &[],
    line: LinePins {
        tx: Pin::new('A', 9),
        enable: Pin::new('A', 8),
        enable_pulled_up: false,
    },
    rs232: None,
    leds: Leds {
        activity: Some(Led {
            pin: Pin::new('B', 8),
            lit_by: true,
        }),
        fault: Some(Led {
            pin: Pin::new('B', 9),
            lit_by: true,
        }),
        run: Led {
            pin: Pin::new('C', 13),
            lit_by: false,
        },
    },
    pulled_up: &[],
    radio: None,
};

/// The modio-02: one slot.
pub const MODIO_02: Layout = Layout {
    board: &board::MODIO_02,
    part: STM32F103CB,
    slots: &[slot(5, 0, [('A', 0), ('A', 1), ('A', 2), ('A', 3)])],
    switch: &pins([
        ('A', 4),
        ('A', 5),
        ('A', 6),
        ('A', 7),
        ('B', 12),
        ('B', 13),
        ('B', 14),
        ('B', 15),
    ]),
    radio: Some(RadioPins {
        m0: Pin::new('B', 0),
        m1: Pin::new('B', 1),
        aux: Pin::new('B', 5),
    }),
    ..MODIO
};

/// The modio-08: four slots.
pub const MODIO_08: Layout = Layout {
    board: &board::MODIO_08,
    part: STM32F103RC,
    slots: &[
        slot(1, 0, [('A', 0), ('A', 1), ('A', 2), ('A', 3)]),
        slot(2, 1, [('A', 4), ('A', 5), ('A', 6), ('A', 7)]),
        slot(3, 2, [('C', 0), ('C', 1), ('C', 2), ('C', 3)]),
        slot(4, 3, [('B', 0), ('B', 1), ('C', 4), ('C', 5)]),
    ],
    switch: &pins([
        ('C', 6),
        ('C', 7),
        ('C', 8),
        ('C', 9),
        ('B', 12),
        ('B', 13),
        ('B', 14),
        ('B', 15),
    ]),
    radio: Some(RadioPins {
        m0: Pin::new('C', 10),
        m1: Pin::new('C', 11),
        aux: Pin::new('C', 12),
    }),
    ..MODIO
};

impl Layout {
    /// All types of boards.
    const ALL: [&'static Self; Row::ALL.len()] =
        [&MODIO_02, &MODIO_08, &FX3U_14, &FX3U_24, &ETH_IO5R];

    /// Returns the layout of a board of the register map.
    #[must_use]
    pub fn of(board: &Row) -> Option<&'static Self> {
        Self::ALL.into_iter().find(|layout| layout.board == board)
    }
}

/// Returns a slot whose DAC has the `dac`th address.
const fn slot(port: u8, dac: u8, lines: [(char, usize); 4]) -> SlotPins {
    SlotPins {
        port,
        lines: pins(lines),
        dac_address: mcp4728::ADDRESS + dac,
    }
}

const fn pins<const N: usize>(names: [(char, usize); N]) -> [Pin; N] {
    let mut pins = [Pin::new('A', 0); N];
    let mut n = 0;
    while n < N {
        pins[n] = Pin::new(names[n].0, names[n].1);
        n += 1;
    }
    pins
}

#[cfg(test)]
mod tests {
    use super::*;
    use f103::memory::FLASH_BASE;

    #[test]
    fn every_board_of_the_register_map_has_a_layout_that_matches() {
        for board in Row::ALL {
            let layout = Layout::of(board).unwrap();
            assert_eq!(layout.switch.is_empty(), !board.switch, "{board}");
            assert_eq!(
                layout.terminals.is_empty(),
                board.fixed.is_empty(),
                "{board}"
            );
            if layout.terminals.is_empty() {
                let ports = layout.slots.iter().map(|slot| u16::from(slot.port));
                assert!(ports.eq(board.ports()), "{board}");
            }
            if let Some(radio) = layout.radio {
                assert_eq!(radio.m0.port(), radio.m1.port(), "{board}");
            }
            assert_eq!(
                layout.part.page_size,
                board.store().bytes as usize,
                "{board}"
            );
            for page in board.store().addresses() {
                let end = (page + board.store().bytes - FLASH_BASE) as usize;
                assert!(end <= layout.part.flash_size, "{board}");
            }
        }
    }
}
