//! Comparison of registers with their settings while the device runs. A disturbance of the part may change any bit
//! of a register, and the unit must then serve again without a restart.
//!
//! [`Registers::record`] reads every register of the table once, after the start. [`Registers::check`] compares some
//! of them in every millisecond:
//!
//! | block | checked | a wrong register is |
//! |---|---|---|
//! | RS-485 line: its UART with the pins, TIM2, TIM1, edges | one row per millisecond, while no reply is being sent | set up with its block by the caller |
//! | clocks and resets | one row each time, and first when any other row is wrong | written |
//! | pins, interrupts, flash | one row each time | written |
//! | scan timer, second line | one row each time | set up with its block by the caller |
//!
//! A register is expected to keep what it returned after the start instead of what was written, because an emulator
//! or a clone of the part may not keep every bit. Pins and bits that change in operation are not in the table: the
//! DACs' bus, the levels of outputs, the pull of the radio's AUX. The table follows from the board's descriptor.
//!
//! Everything but `record` runs from RAM, and the table lies there, too.

mod table;

use table::{
    ALL, CLOCKS, DRIVER_MODES, FLASH_ACR, ICER, ISER, LINE, MAPR, MODES, NVIC, ODR, PERIPHERALS,
    PLACES, ROWS, SCAN_TIMER, SECOND, UART_MODES,
};

use crate::boards::BOARD;

/// Access to registers.
pub trait Bus {
    /// Returns the content of a register.
    fn read(&self, address: u32) -> u32;
    /// Writes a register.
    fn write(&mut self, address: u32, value: u32);
}

/// A register that was wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrong {
    /// It has been written again.
    Mended,
    /// The caller must set the scan timer up.
    ScanTimer,
    /// The caller must set the second line's UART up.
    Second,
    /// The caller must set the line up.
    Line,
}

/// Number of milliseconds after which every row of the line has been checked, one in each.
const LINE_MS: usize = ROWS - LINE;
/// Number of rows outside the line.
const ROUND: u8 = LINE as u8;

/// A register, its compared bits, and what it must return there.
#[derive(Clone, Copy)]
struct Row {
    place: u16,
    mask: i16,
    expected: u32,
}

impl Row {
    #[inline(always)]
    const fn address(&self) -> u32 {
        let is_core = self.place >> 10 == (NVIC >> 12) as u16 & 0x3F;
        let base = if is_core { 0xE000_0000 } else { PERIPHERALS };
        base + self.place as u32 * 4
    }

    #[inline(always)]
    const fn mask(&self) -> u32 {
        self.mask as i32 as u32
    }

    #[inline(always)]
    fn is_wrong(&self, bus: &impl Bus) -> bool {
        bus.read(self.address()) & self.mask() != self.expected
    }

    /// The same for a register that is not the core's: faster, because the line's interrupts wait for it.
    #[inline(always)]
    fn is_wrong_peripheral(&self, bus: &impl Bus) -> bool {
        let address = PERIPHERALS + u32::from(self.place) * 4;
        bus.read(address) & self.mask() != self.expected
    }

    #[inline(never)]
    #[cfg_attr(target_os = "none", unsafe(link_section = ".ram_code"))]
    fn write(&self, bus: &mut impl Bus) {
        let address = self.address();
        if address & !4 == NVIC + ISER as u32 {
            // Writing 0 to ISER does not disable an interrupt (PM0056 4.3.2).
            bus.write(address + (ICER - ISER) as u32, !self.expected);
        }
        let written = if BOARD.mapr != 0 && address == MAPR {
            BOARD.mapr & !self.mask()
        } else {
            bus.read(address) & !self.mask()
        };
        bus.write(address, written | self.expected);
    }
}

/// The table.
pub struct Registers {
    rows: [Row; ROWS],
    /// The last row that was checked outside the line, and the last part of the line.
    row: u8,
    part: u8,
}

impl Registers {
    /// Records the present settings. Each line is compared only when it is in use. Call this when
    /// everything is set up and the scan timer runs.
    pub fn record(bus: &impl Bus, line: bool, second: bool) -> Self {
        const NOTHING: Row = Row {
            place: (FLASH_ACR >> 2) as u16,
            mask: 0,
            expected: 0,
        };
        let mut rows = [NOTHING; ROWS];
        for (n, (row, (place, mask))) in rows.iter_mut().zip(PLACES).enumerate() {
            // A block that is not in use may have no clock.
            if n < SECOND || n >= LINE && line || n < LINE && second {
                (row.place, row.mask) = (place, mask);
                if (CLOCKS..MODES).contains(&n) {
                    row.mask &= pulled(bus, row.address() - u32::from(ODR));
                }
                if !line && [UART_MODES, DRIVER_MODES].contains(&row.address()) {
                    // The pins of a line that is not in use: its driver must stay off.
                    row.mask = ALL;
                }
                row.expected = bus.read(row.address()) & row.mask();
            }
        }
        Self {
            rows,
            row: 0,
            part: 0,
        }
    }

    /// Compares a register of the line, unless a reply is being sent, and one of the `others`, and repairs those
    /// that no block owns. Returns what is wrong, if anything. Call this at the highest priority in use.
    #[inline(always)]
    pub fn check(&mut self, bus: &mut impl Bus, is_sending: bool, others: bool) -> Option<Wrong> {
        if !is_sending && self.line_is_wrong(bus) {
            return Some(self.repair(bus, LINE));
        }
        if !others {
            return None;
        }
        self.row += 1;
        if self.row >= ROUND {
            self.row = 0;
        }
        let row = usize::from(self.row);
        let is_wrong = self.rows.get(row).is_some_and(|row| row.is_wrong(bus));
        is_wrong.then(|| self.repair(bus, row))
    }

    /// Returns whether the line's register of this millisecond is wrong.
    #[inline(always)]
    fn line_is_wrong(&mut self, bus: &impl Bus) -> bool {
        self.part += 1;
        if self.part >= LINE_MS as u8 {
            self.part = 0;
        }
        let row = self.rows.get(LINE + usize::from(self.part));
        row.is_some_and(|row| row.is_wrong_peripheral(bus))
    }

    /// Repairs a wrong row, but first the clocks: a block without its clock returns 0, so its registers say nothing.
    #[inline(never)]
    #[cfg_attr(target_os = "none", unsafe(link_section = ".ram_code"))]
    fn repair(&mut self, bus: &mut impl Bus, wrong: usize) -> Wrong {
        let mut clocks = false;
        for row in self.rows.iter().take(CLOCKS) {
            if row.is_wrong(bus) {
                row.write(bus);
                clocks = true;
            }
        }
        if clocks {
            self.row = 0;
        } else if wrong >= LINE {
            return Wrong::Line;
        } else if wrong >= SECOND {
            return Wrong::Second;
        } else if wrong >= SCAN_TIMER {
            return Wrong::ScanTimer;
        } else if let Some(row) = self.rows.get(wrong) {
            row.write(bus);
        }
        Wrong::Mended
    }
}

/// Returns the pins of a port that are inputs with a pull-up or pull-down, one bit each (RM0008 table 20).
fn pulled(bus: &impl Bus, port: u32) -> i16 {
    (0..16)
        .filter(|pin| bus.read(port + pin / 8 * 4) >> (pin % 8 * 4) & 0xF == 8)
        .fold(0, |pins, pin| pins | 1 << pin)
}

/// The bus of the part.
#[cfg(target_os = "none")]
pub struct Part;

#[cfg(target_os = "none")]
impl Bus for Part {
    #[inline(always)]
    fn read(&self, address: u32) -> u32 {
        // SAFETY: the addresses of the table are those of registers that exist on every part of the family and that a
        // read does not change.
        unsafe { core::ptr::read_volatile(address as *const u32) }
    }

    #[inline(always)]
    fn write(&mut self, address: u32, value: u32) {
        // SAFETY: as above. The value is that of the set-up. The caller runs at the highest priority in use, so no
        // other access comes between the read and this write.
        unsafe { core::ptr::write_volatile(address as *mut u32, value) };
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::{collections::BTreeMap, vec::Vec};

    use super::{
        table::{RCC, SECOND_UART, TIM2, UART},
        *,
    };
    use crate::pin::Port;

    const PORT_A: u32 = Port::A.base();
    const APB1ENR: u32 = RCC + 0x1C;
    const ISER0: u32 = NVIC + 0x100;

    /// Registers that keep what is written, but TIM2 returns 0 without its clock.
    #[derive(Clone)]
    struct Memory(BTreeMap<u32, u32>);

    impl Bus for Memory {
        fn read(&self, address: u32) -> u32 {
            let is_off = (TIM2..TIM2 + 0x400).contains(&address) && self.0[&APB1ENR] & 1 == 0;
            if is_off { 0 } else { self.0[&address] }
        }

        fn write(&mut self, address: u32, value: u32) {
            let register = self.0.entry(address & !0x80).or_default();
            match address & !4 {
                ISER0 => *register |= value,
                address if address == ISER0 + 0x80 => *register &= !value,
                _ => *register = value,
            }
        }
    }

    /// Returns all registers, each with another content. PA0 is an input with a pull-up.
    fn set_up() -> Memory {
        let rows = (1_u32..).zip(PLACES);
        let mut memory = Memory(
            rows.map(|(n, (place, mask))| {
                let row = Row {
                    place,
                    mask,
                    expected: 0,
                };
                (row.address(), n.wrapping_mul(0x0101_0101) & 0x7777_7777)
            })
            .collect(),
        );
        memory.0.insert(PORT_A, 0x3333_3338);
        memory.0.insert(APB1ENR, 0x5555_5555);
        let mapr = memory.0[&MAPR] & 0x7FFF | BOARD.mapr;
        memory.0.insert(MAPR, mapr);
        memory
    }

    fn run(registers: &mut Registers, memory: &mut Memory, ms: u8) -> Vec<Wrong> {
        let checks = (0..ms).filter_map(|_| registers.check(memory, false, true));
        checks.collect()
    }

    #[test]
    fn any_changed_bit_is_found_within_a_round_and_the_lines_earlier() {
        let memory = set_up();
        let recorded = Registers::record(&memory, true, true);
        for (n, row) in recorded.rows.iter().enumerate() {
            let (wrong, ms) = match n {
                LINE.. => (Wrong::Line, LINE_MS as u8),
                SECOND.. => (Wrong::Second, ROUND),
                SCAN_TIMER.. => (Wrong::ScanTimer, ROUND),
                _ => (Wrong::Mended, ROUND),
            };
            for bit in 0..32 {
                let mut memory = memory.clone();
                let mut registers = Registers::record(&memory, true, true);
                *memory.0.get_mut(&row.address()).unwrap() ^= 1 << bit;
                let found = run(&mut registers, &mut memory, ms);
                if row.mask() >> bit & 1 != 0 {
                    assert_eq!(found.first(), Some(&wrong), "row {n} bit {bit}");
                }
                if wrong == Wrong::Mended && row.mask() >> bit & 1 != 0 {
                    assert_eq!(
                        (found.len(), &memory.0),
                        (1, &set_up().0),
                        "row {n} bit {bit}"
                    );
                }
            }
        }
        assert_eq!(recorded.rows[CLOCKS].mask, 1, "the pull of PA0 alone");
    }

    #[test]
    fn clocks_are_mended_before_a_block_without_clock_is_set_up() {
        let mut memory = set_up();
        let mut registers = Registers::record(&memory, true, true);
        *memory.0.get_mut(&APB1ENR).unwrap() &= !1;
        assert_eq!(
            run(&mut registers, &mut memory, LINE_MS as u8),
            [Wrong::Mended]
        );
        assert_eq!(run(&mut registers, &mut memory, ROUND), []);
    }

    #[test]
    fn line_is_not_compared_while_it_sends_or_is_not_used() {
        let mut memory = set_up();
        let mut registers = Registers::record(&memory, true, true);
        let mut unused = Registers::record(&memory, false, false);
        memory.0.insert(UART + 0x0C, 0);
        for _ in 0..ROUND {
            assert_eq!(registers.check(&mut memory, true, true), None);
        }
        assert_eq!(
            run(&mut registers, &mut memory, LINE_MS as u8),
            [Wrong::Line]
        );
        memory.0.insert(SECOND_UART + 0x0C, 0);
        assert_eq!(run(&mut unused, &mut memory, ROUND), []);
    }
}
