//! The types of boards: their parts, slots and pins.

use register_map::{Board, board};

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

/// A type of board. The RS-485 line (PA8 to PA10), I2C1 (PB6, PB7), the LEDs (PB8, PB9, PC13) and the UART of the LoRa
/// module (PB10, PB11) are the same on all.
#[derive(Clone, Copy, Debug)]
pub struct Layout {
    /// The board in the register map: its name, its ports, and the pages in which the configuration is stored.
    pub board: &'static Board,
    /// The microcontroller.
    pub part: Part,
    /// The slots. Methods without a port number mean the first one.
    pub slots: &'static [SlotPins],
    /// Pins of DIP switch SW01, position 1 first. ON = low.
    pub switch: [Pin; 8],
    /// Pins of the LoRa module. M0 and M1 are on the same port.
    pub radio: RadioPins,
}

/// The modio-02: one slot.
pub const MODIO_02: Layout = Layout {
    board: &board::MODIO_02,
    part: STM32F103CB,
    slots: &[slot(5, 0, [('A', 0), ('A', 1), ('A', 2), ('A', 3)])],
    switch: pins([
        ('A', 4),
        ('A', 5),
        ('A', 6),
        ('A', 7),
        ('B', 12),
        ('B', 13),
        ('B', 14),
        ('B', 15),
    ]),
    radio: RadioPins {
        m0: Pin::new('B', 0),
        m1: Pin::new('B', 1),
        aux: Pin::new('B', 5),
    },
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
    switch: pins([
        ('C', 6),
        ('C', 7),
        ('C', 8),
        ('C', 9),
        ('B', 12),
        ('B', 13),
        ('B', 14),
        ('B', 15),
    ]),
    radio: RadioPins {
        m0: Pin::new('C', 10),
        m1: Pin::new('C', 11),
        aux: Pin::new('C', 12),
    },
};

impl Layout {
    /// All types of boards.
    pub const ALL: [&'static Self; 2] = [&MODIO_02, &MODIO_08];

    /// Returns the layout of a board of the register map.
    #[must_use]
    pub fn of(board: &Board) -> Option<&'static Self> {
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
        for board in Board::ALL {
            let layout = Layout::of(board).unwrap();
            let ports = layout.slots.iter().map(|slot| u16::from(slot.port));
            assert!(ports.eq(board.ports()), "{board}");
            assert_eq!(layout.radio.m0.port(), layout.radio.m1.port(), "{board}");
            assert_eq!(layout.part.page_size, board.store.bytes as usize, "{board}");
            for page in board.store.addresses() {
                let end = (page + board.store.bytes - FLASH_BASE) as usize;
                assert!(end <= layout.part.flash_size, "{board}");
            }
        }
    }
}
