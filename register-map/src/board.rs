//! The boards: a row for each, with its code, its name, its ports and its memory. `board-support` describes the pins.

use core::fmt;
use core::ops::Range;
use core::str::FromStr;

use crate::fixed::FixedPort;
use crate::kind::Kind;
use crate::layout::{Layout, TwoPages};
use crate::part::{KIB, Part, STM32F103C8, STM32F103CB, STM32F103RC, STM32F103VC};
use crate::{BLOCKS, Module, Rule, Text, configuration, deadband, links, points, second};

/// A board that the firmware is built for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Board {
    /// Name on command lines and in the device identification, such as `modio-02`.
    pub name: &'static str,
    /// Value of register BOARD (0x0205).
    pub code: u16,
    /// Model name in the device identification: the product that the board replaces, if there is one.
    pub model: &'static str,
    /// First port with points, 1 to 8.
    pub first_port: u16,
    /// Number of consecutive ports with points, 1 to 8. All other ports have none.
    pub slots: u16,
    /// The ports in their order, if their inputs and outputs are part of the board. Empty for a board with slots.
    pub fixed: &'static [FixedPort],
    /// A switch has the unit address. Without it register UNIT has.
    pub switch: bool,
    /// The second line, if there is one.
    pub second: Option<Second>,
    /// Flash pages that store the configuration, while the application runs without a loader.
    pub store: TwoPages,
}

/// What the second line of a board is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Second {
    /// A LoRa radio, with the settings LORA to LORA_FRAME_GAP.
    Radio,
    /// An RS-232 socket with 9600 8N1.
    Rs232,
}

/// What the image of a board is linked for, and what it may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Memory {
    /// The part on the board.
    pub part: Part,
    /// A smaller part that the same image must fit. The store lies in its last pages.
    pub smaller: Option<Part>,
    /// Bytes of the stack, at the start of the RAM. The tests find at least 1 KiB of it unused.
    pub stack: u32,
    /// Names of the interrupts to which the application binds LINE, SECOND and SERVE: those of the UARTs of the RS-485 line
    /// and of the second line, and an unused one.
    pub interrupts: [&'static str; 3],
}

impl Memory {
    /// Returns the smallest part.
    #[must_use]
    pub const fn least(&self) -> Part {
        match self.smaller {
            Some(smaller) => smaller,
            None => self.part,
        }
    }
}

/// A board: everything about it but its pins, which are in `board-support`.
struct Row {
    name: &'static str,
    code: u16,
    model: &'static str,
    first_port: u16,
    slots: u16,
    fixed: &'static [FixedPort],
    switch: bool,
    second: Option<Second>,
    memory: Memory,
}

/// The memory of both clones of the FX3U.
const FX3U: Memory = Memory {
    part: STM32F103VC,
    smaller: None,
    stack: 14 * KIB,
    interrupts: ["UART4", "USART1", "EXTI3"],
};

const ROWS: [Row; 5] = [
    // The LLD-ModbusIO-02 with an STM32F103CB, or a C8 on a "Blue Pill": one slot, port 5.
    Row {
        name: "modio-02",
        code: 1,
        model: "LLD-ModbusIO-02",
        first_port: 5,
        slots: 1,
        fixed: &[],
        switch: true,
        second: Some(Second::Radio),
        memory: Memory {
            part: STM32F103CB,
            smaller: Some(STM32F103C8),
            stack: 9 * KIB,
            interrupts: ["USART1", "USART3", "EXTI3"],
        },
    },
    // The larger board with an STM32F103RC: four slots, ports 1 to 4.
    Row {
        name: "modio-08",
        code: 2,
        model: "modio-08",
        first_port: 1,
        slots: 4,
        fixed: &[],
        switch: true,
        second: Some(Second::Radio),
        memory: Memory {
            part: STM32F103RC,
            smaller: None,
            stack: 11 * KIB,
            interrupts: ["USART1", "USART3", "EXTI3"],
        },
    },
    // The FX3U-14MR's clone: an STM32F103VC.
    Row {
        name: "fx3u-14",
        code: 3,
        model: "FX3U-14MR",
        first_port: 1,
        slots: 7,
        fixed: &[
            FixedPort::new(Module::Di4, 4),
            FixedPort::new(Module::Di4, 4),
            FixedPort::new(Module::Do4, 4),
            FixedPort::new(Module::Do4, 2),
            FixedPort::new(Module::Ai4, 4).currents(0b1000),
            FixedPort::new(Module::Ai4, 4).currents(0b0011),
            FixedPort::new(Module::Ao4, 2),
        ],
        switch: false,
        second: Some(Second::Rs232),
        memory: FX3U,
    },
    // The FX3U-24MR's clone: an STM32F103VC.
    Row {
        name: "fx3u-24",
        code: 4,
        model: "FX3U-24MR",
        first_port: 1,
        slots: 8,
        fixed: &[
            FixedPort::new(Module::Di4, 4),
            FixedPort::new(Module::Di4, 4),
            FixedPort::new(Module::Di4, 4),
            FixedPort::new(Module::Di4, 4),
            FixedPort::new(Module::Do4, 4),
            FixedPort::new(Module::Do4, 4),
            FixedPort::new(Module::Do4, 2),
            FixedPort::new(Module::Ai4, 4)
                .currents(0b1000)
                .or(Module::Ai2Ao2),
        ],
        switch: false,
        second: Some(Second::Rs232),
        memory: FX3U,
    },
    // The "eth_modbus_io5r": an STM32F103CB.
    Row {
        name: "eth-io5r",
        code: 5,
        model: "eth_modbus_io5r",
        first_port: 1,
        slots: 4,
        fixed: &[
            FixedPort::new(Module::Di4, 4),
            FixedPort::new(Module::Di4, 2),
            FixedPort::new(Module::Do4, 4),
            FixedPort::new(Module::Do4, 1),
        ],
        switch: false,
        second: None,
        memory: Memory {
            part: STM32F103CB,
            smaller: None,
            stack: 9 * KIB,
            interrupts: ["USART2", "USART3", "EXTI2"],
        },
    },
];

impl Row {
    const fn board(&self) -> Board {
        let part = self.memory.least();
        Board {
            name: self.name,
            code: self.code,
            model: self.model,
            first_port: self.first_port,
            slots: self.slots,
            fixed: self.fixed,
            switch: self.switch,
            second: self.second,
            store: TwoPages::before(part.flash, &part),
        }
    }
}

/// The modio-02.
pub const MODIO_02: Board = ROWS[0].board();
/// The modio-08.
pub const MODIO_08: Board = ROWS[1].board();
/// The fx3u-14.
pub const FX3U_14: Board = ROWS[2].board();
/// The fx3u-24.
pub const FX3U_24: Board = ROWS[3].board();
/// The eth-io5r.
pub const ETH_IO5R: Board = ROWS[4].board();

impl Board {
    /// All boards, in the order of their codes.
    pub const ALL: [&'static Self; ROWS.len()] =
        [&MODIO_02, &MODIO_08, &FX3U_14, &FX3U_24, &ETH_IO5R];

    /// Every code of register BOARD with the board's name.
    pub const NAMES: [(u16, &'static str); Self::ALL.len()] = {
        let mut names = [(0, ""); Self::ALL.len()];
        let mut i = 0;
        while i < names.len() {
            names[i] = (Self::ALL[i].code, Self::ALL[i].name);
            i += 1;
        }
        names
    };

    /// Returns the memory of the board.
    #[must_use]
    pub const fn memory(&self) -> &'static Memory {
        let mut rows: &[Row] = const { &ROWS };
        while let [row, others @ ..] = rows {
            if row.code == self.code {
                return &row.memory;
            }
            rows = others;
        }
        panic!("every board comes from a row")
    }

    /// Returns where loader, images, boot state and configuration are in the flash of the board's part.
    #[must_use]
    pub const fn layout(&self) -> Layout {
        Layout::of(&self.memory().part)
    }

    /// Returns the board with this code in register BOARD.
    #[must_use]
    pub fn from_code(code: u16) -> Option<&'static Self> {
        Self::ALL.into_iter().find(|board| board.code == code)
    }

    /// Returns the board with this name.
    #[must_use]
    pub const fn named(name: &str) -> Option<&'static Self> {
        let mut i = 0;
        while i < Self::ALL.len() {
            if same(Self::ALL[i].name.as_bytes(), name.as_bytes()) {
                return Some(Self::ALL[i]);
            }
            i += 1;
        }
        None
    }

    /// Returns the ports with points, in ascending order.
    #[must_use]
    pub const fn ports(&self) -> Range<u16> {
        self.first_port..self.first_port + self.slots
    }

    /// Iterates over the registers of the board besides the points, or runs of similar ones, with their texts, in
    /// ascending order of the addresses.
    pub fn registers(&self) -> impl Iterator<Item = (&'static Rule, &'static Text)> {
        let blocks = BLOCKS.iter().skip(1);
        let registers = blocks.flat_map(|block| block.registers());
        let registers = registers.filter(|(rule, _)| self.has(rule.first));
        registers.map(|register| match register.0.first {
            configuration::START if self.is_small() => {
                let (rule, text) = &configuration::PLAIN_START;
                (rule, text)
            }
            _ => register,
        })
    }

    /// Returns whether the firmware of the board leaves out function 70, DEADBAND and START = as it was, for which the flash
    /// of the smallest parts has no room: feature `small`.
    #[must_use]
    pub const fn is_small(&self) -> bool {
        self.memory().part.flash <= 128 * KIB
    }

    /// Returns whether the second line is a radio.
    #[must_use]
    pub const fn has_radio(&self) -> bool {
        matches!(self.second, Some(Second::Radio))
    }

    /// Returns whether the board has a register, which every board has or every board of some kind. Links exist only for
    /// some of the points.
    #[must_use]
    pub const fn has(&self, address: u16) -> bool {
        match address {
            configuration::UNIT => !self.switch,
            configuration::LORA..=configuration::LORA_FRAME_GAP => self.has_radio(),
            second::BUS_MESSAGES..=second::T15_GAPS => self.second.is_some(),
            _ if deadband::contain(address) => !self.is_small(),
            _ => links::exist(self.slots as usize) || !links::contain(address),
        }
    }

    /// Returns the port with this number, 1 to 8, if its inputs and outputs are part of the board.
    #[must_use]
    pub fn fixed(&self, port: u16) -> Option<&'static FixedPort> {
        self.fixed
            .get(usize::from(port.wrapping_sub(self.first_port)))
    }

    /// Returns whether MODULE of a port, 1 to 8, can be written.
    #[must_use]
    pub fn chooses(&self, port: u16) -> bool {
        self.fixed.is_empty() || self.fixed(port).is_some_and(|port| port.or.is_some())
    }

    /// Returns whether MODULE of a port, 1 to 8, may have this value. A port without points has no module.
    #[must_use]
    pub fn takes(&self, port: u16, code: u16) -> bool {
        match self.fixed(port) {
            Some(fixed) => fixed.takes(code),
            None => code == 0 || self.fixed.is_empty() && self.has_slot(port),
        }
    }

    /// Returns the kinds of the points of a port, 1 to 8, with this module.
    #[must_use]
    pub fn kinds(&self, port: u16, module: Module) -> [Kind; 4] {
        match self.fixed(port) {
            Some(fixed) => fixed.kinds(module),
            None => module.points(),
        }
    }

    /// Returns whether a port has points.
    #[inline]
    #[must_use]
    pub const fn has_slot(&self, port: u16) -> bool {
        port.wrapping_sub(self.first_port) < self.slots
    }

    /// Returns the addresses of the points of all ports.
    #[must_use]
    pub const fn points(&self) -> Range<u16> {
        let first = points::of_port(self.first_port);
        first..first + self.slots * points::CHANNELS
    }
}

/// Compares two names, also at compile time.
const fn same(one: &[u8], other: &[u8]) -> bool {
    match (one.split_first(), other.split_first()) {
        (Some((a, one)), Some((b, other))) => *a == *b && same(one, other),
        (None, None) => true,
        _ => false,
    }
}

impl fmt::Display for Board {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name)
    }
}

/// Error for a name that is not that of a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownBoard;

impl fmt::Display for UnknownBoard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("not a board; one of")?;
        for (i, board) in Board::ALL.iter().enumerate() {
            write!(f, "{} {board}", if i == 0 { "" } else { "," })?;
        }
        Ok(())
    }
}

impl core::error::Error for UnknownBoard {}

impl FromStr for &'static Board {
    type Err = UnknownBoard;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Board::named(name).ok_or(UnknownBoard)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::string::ToString;

    use super::*;

    #[test]
    fn a_board_is_found_by_its_code_and_its_name() {
        for board in Board::ALL {
            assert_eq!(Board::from_code(board.code), Some(board));
            assert_eq!(board.to_string().parse(), Ok(board));
        }
        assert_eq!(Board::from_code(0), None);
        let error = "nucleo".parse::<&Board>().unwrap_err();
        let names = Board::ALL.map(|board| board.name).join(", ");
        assert_eq!(
            error.to_string(),
            std::format!("not a board; one of {names}")
        );
    }

    #[test]
    fn slots_are_at_the_ports_of_the_hardware() {
        assert_eq!(MODIO_02.points(), 0x10..0x14);
        assert_eq!(MODIO_08.points(), 0x00..0x10);
        let slots = |board: &Board| (0..10).filter(|port| board.has_slot(*port)).count();
        assert_eq!((slots(&MODIO_02), slots(&MODIO_08)), (1, 4));
        assert!(MODIO_02.ports().eq([5]) && MODIO_08.ports().eq(1..=4));
    }

    #[test]
    fn start_as_it_was_exists_on_boards_that_keep_outputs() {
        for board in Board::ALL {
            let start = |(rule, _): &(&Rule, &Text)| rule.first == configuration::START;
            let (rule, text) = board.registers().find(start).unwrap();
            let kinds = [Kind::BitOutput, Kind::WordOutput];
            let allowed = kinds.map(|kind| rule.values_for(kind).allow(configuration::AS_IT_WAS));
            assert_eq!(allowed, [!board.is_small(); 2], "{board}");
            assert_eq!(text.about.contains("as it was"), !board.is_small());
            assert_eq!((text.name, rule.count), ("START", 32));
        }
        assert!(!MODIO_08.is_small() && MODIO_02.is_small());
    }

    #[test]
    fn store_is_in_the_last_pages_of_the_smallest_part() {
        assert_eq!(MODIO_02.store.addresses(), [0x0800_F800, 0x0800_FC00]);
        assert_eq!(MODIO_08.store.addresses(), [0x0803_F000, 0x0803_F800]);
    }
}
