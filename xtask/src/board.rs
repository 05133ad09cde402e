//! Properties of a board that the register map does not have: its parts, and how much of them the application may use.

use register_map::Board;

const KIB: u32 = 1024;

/// An amount of memory, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    /// The name of a part in probe-rs, or `budget`.
    pub name: &'static str,
    /// Bytes of flash.
    pub flash: u32,
    /// Bytes of RAM.
    pub ram: u32,
}

impl Memory {
    const fn kib(name: &'static str, flash: u32, ram: u32) -> Self {
        Self {
            name,
            flash: flash * KIB,
            ram: ram * KIB,
        }
    }
}

/// The hardware of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hardware {
    board: &'static Board,
    /// The part on the board (STM32F103xB and xE data sheets).
    pub part: Memory,
    /// Another part that the image must fit as well.
    pub smaller: Option<Memory>,
    /// The most that the application may use. The rest is for the stack, the configuration store and a loader.
    pub budget: Memory,
}

/// One row for each board.
const HARDWARE: [Hardware; 2] = [
    Hardware {
        board: &register_map::board::MODIO_02,
        part: Memory::kib("STM32F103CB", 128, 20),
        smaller: Some(Memory::kib("STM32F103C8", 64, 20)),
        budget: Memory::kib("budget", 49, 9),
    },
    Hardware {
        board: &register_map::board::MODIO_08,
        part: Memory::kib("STM32F103RC", 256, 48),
        smaller: None,
        budget: Memory::kib("budget", 50, 12),
    },
];

impl Hardware {
    /// Returns the hardware of a board.
    pub fn of(board: &Board) -> &'static Self {
        let row = HARDWARE.iter().find(|row| row.board == board);
        row.expect("every board has a row in HARDWARE")
    }

    /// Returns the limits of the image: the parts, the smaller one first, and the budget.
    pub fn limits(&self) -> impl Iterator<Item = Memory> {
        let parts = self.smaller.into_iter().chain([self.part]);
        parts.chain([self.budget])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn configuration_is_stored_in_flash_that_every_part_has() {
        for board in Board::ALL {
            let hardware = Hardware::of(board);
            let least = hardware.smaller.unwrap_or(hardware.part).flash;
            let end = board.store.first + 2 * board.store.bytes;
            assert_eq!(end, crate::image::FLASH_BASE + least, "{board}");
        }
    }
}
