//! The boards: a [`Row`] for each, with its code, its name, its ports and its memory; and a type for each, a [`Board`]. The
//! rows are in `rows.rs`. `board-support` describes the pins.

mod rows;

use core::fmt;
use core::ops::Range;
use core::str::FromStr;

use crate::fixed::FixedPort;
use crate::kind::Kind;
use crate::layout::{Layout, TwoPages};
use crate::part::Part;
use crate::{BLOCKS, Module, Rule, Text, configuration, deadband, links, points, second, stage};

pub use crate::count::{Count, Each, Exactly};
use rows::ROWS;
pub use rows::*;

/// A board as a type, the same on the device and in tests. What a board lacks is a constant in its row, so that the
/// compiler leaves out the code for it, and a count of 0, so that its settings and values take no RAM.
pub trait Board: Copy + fmt::Debug + Eq + 'static {
    /// The board.
    const ROW: &'static Row;
    /// Its ports with points.
    type Ports: Count;
    /// 1 if it has events: function 70 and DEADBAND.
    type Events: Count;
    /// 1 if it has START = as it was.
    type Kept: Count;
    /// 1 if it has the stage of digital outputs.
    type Stage: Count;
    /// Its settings behind the links.
    type BehindLinks: Count;
    /// 1 if it has a second line.
    type Second: Count;
    /// Number of its ports with points.
    const PORTS: usize = Self::Ports::COUNT;
}

/// What a board is, but for its pins, which are in `board-support`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
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
    /// Function 70 and DEADBAND. The flash of the smallest parts has no room for them: docs/decisions.md.
    pub events: bool,
    /// START = as it was. As above.
    pub keeps_outputs: bool,
    /// The stage of digital outputs: DEAD_TIME, MAX_ON, MIN_OFF. As above.
    pub stage: bool,
    /// What the image is linked for.
    pub memory: Memory,
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

impl Row {
    /// All boards, in the order of their codes.
    pub const ALL: [&'static Self; ROWS.len()] = ROWS;

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

    /// Returns the flash pages that store the configuration, while the application runs without a loader.
    #[must_use]
    pub const fn store(&self) -> TwoPages {
        let part = self.memory.least();
        TwoPages::before(part.flash, &part)
    }

    /// Returns where loader, images, boot state and configuration are in the flash of the board's part.
    #[must_use]
    pub const fn layout(&self) -> Layout {
        Layout::of(&self.memory.part)
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
            configuration::START if !self.keeps_outputs => {
                let (rule, text) = &configuration::PLAIN_START;
                (rule, text)
            }
            _ => register,
        })
    }

    /// Returns whether its inputs and outputs are on modules in slots. If not, they are part of the board.
    #[inline(always)]
    #[must_use]
    pub const fn is_modular(&self) -> bool {
        self.fixed.is_empty()
    }

    /// Returns the addresses of the settings behind the links, all by point: DEADBAND, then those of the stage. The board
    /// has one of the two, both or none.
    #[must_use]
    pub const fn behind_links(&self) -> Range<u16> {
        let first = if self.events {
            deadband::DEADBAND
        } else {
            stage::DEAD_TIME
        };
        let end = if self.stage {
            stage::ADDRESSES.end
        } else {
            stage::DEAD_TIME
        };
        first..end
    }

    /// Returns whether inputs can switch outputs.
    #[inline(always)]
    #[must_use]
    pub const fn has_links(&self) -> bool {
        links::exist(self.slots as usize)
    }

    /// Returns the rules of the configuration.
    #[inline(always)]
    #[must_use]
    pub fn rules(&self) -> &'static [Rule] {
        if self.keeps_outputs {
            configuration::RULES
        } else {
            configuration::PLAIN_RULES
        }
    }

    /// Returns whether it can have analog inputs.
    #[must_use]
    pub const fn has_analog_inputs(&self) -> bool {
        let mut ports = self.fixed;
        let mut has = self.is_modular();
        while let [port, others @ ..] = ports {
            has |= matches!(port.module, Module::Ai4);
            ports = others;
        }
        has
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
            _ if deadband::contain(address) => self.events,
            _ if stage::contain(address) => self.stage,
            _ => self.has_links() || !links::contain(address),
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
        self.is_modular() || self.fixed(port).is_some_and(|port| port.or.is_some())
    }

    /// Returns whether MODULE of a port, 1 to 8, may have this value. A port without points has no module.
    #[must_use]
    pub fn takes(&self, port: u16, code: u16) -> bool {
        match self.fixed(port) {
            Some(fixed) => fixed.takes(code),
            None => code == 0 || self.is_modular() && self.has_slot(port),
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

impl fmt::Display for Row {
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
        for (i, board) in Row::ALL.iter().enumerate() {
            write!(f, "{} {board}", if i == 0 { "" } else { "," })?;
        }
        Ok(())
    }
}

impl core::error::Error for UnknownBoard {}

impl FromStr for &'static Row {
    type Err = UnknownBoard;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Row::named(name).ok_or(UnknownBoard)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::string::ToString;

    use super::*;

    #[test]
    fn a_board_is_found_by_its_code_and_its_name() {
        for board in Row::ALL {
            assert_eq!(Row::from_code(board.code), Some(board));
            assert_eq!(board.to_string().parse(), Ok(board));
        }
        assert_eq!(Row::from_code(0), None);
        let error = "nucleo".parse::<&Row>().unwrap_err();
        let names = Row::ALL.map(|board| board.name).join(", ");
        assert_eq!(
            error.to_string(),
            std::format!("not a board; one of {names}")
        );
    }

    #[test]
    fn slots_are_at_the_ports_of_the_hardware() {
        assert_eq!(MODIO_02.points(), 0x10..0x14);
        assert_eq!(MODIO_08.points(), 0x00..0x10);
        let slots = |board: &Row| (0..10).filter(|port| board.has_slot(*port)).count();
        assert_eq!((slots(&MODIO_02), slots(&MODIO_08)), (1, 4));
        assert!(MODIO_02.ports().eq([5]) && MODIO_08.ports().eq(1..=4));
    }

    #[test]
    fn start_as_it_was_exists_on_boards_that_keep_outputs() {
        for board in Row::ALL {
            let start = |(rule, _): &(&Rule, &Text)| rule.first == configuration::START;
            let (rule, text) = board.registers().find(start).unwrap();
            let kinds = [Kind::BitOutput, Kind::WordOutput];
            let allowed = kinds.map(|kind| rule.values_for(kind).allow(configuration::AS_IT_WAS));
            assert_eq!(allowed, [board.keeps_outputs; 2], "{board}");
            assert_eq!(text.about.contains("as it was"), board.keeps_outputs);
            assert_eq!((text.name, rule.count), ("START", 32));
        }
    }

    #[test]
    fn store_is_in_the_last_pages_of_the_smallest_part() {
        assert_eq!(MODIO_02.store().addresses(), [0x0800_F800, 0x0800_FC00]);
        assert_eq!(MODIO_08.store().addresses(), [0x0803_F000, 0x0803_F800]);
    }
}
