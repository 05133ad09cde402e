//! Comparison of registers with their settings while the device runs. A disturbance of the part may change any bit
//! of a register, and the unit must then serve again without a restart.
//!
//! [`Registers::record`] reads every register of the table once, after the start. [`Registers::check`] compares some
//! of them in every millisecond:
//!
//! | block | checked | a wrong register is |
//! |---|---|---|
//! | RS-485 line: USART1 with its pins, TIM2, TIM1 | one row per millisecond, while no reply is being sent | set up with its block by the caller |
//! | clocks and resets | one row each time, and first when any other row is wrong | written |
//! | pins, interrupts, flash | one row each time | written |
//! | scan timer, radio | one row each time | set up with its block by the caller |
//!
//! A register is expected to keep what it returned after the start instead of what was written, because an emulator
//! or a clone of the part may not keep every bit. Pins and bits that change in operation are not in the table: the
//! DACs' bus, the levels of outputs, the pull of the radio's AUX.
//!
//! Everything but `record` runs from RAM, and the table lies there, too.

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
    /// The caller must set the radio's UART up.
    Radio,
    /// The caller must set the line up.
    Line,
}

const PERIPHERALS: u32 = 0x4000_0000;
// Base addresses (RM0008 table 3, PM0056 4.3).
const TIM2: u32 = 0x4000_0000;
const TIM4: u32 = 0x4000_0800;
const USART3: u32 = 0x4000_4800;
const AFIO: u32 = 0x4001_0000;
const GPIOA: u32 = 0x4001_0800;
const GPIOB: u32 = 0x4001_0C00;
const GPIOC: u32 = 0x4001_1000;
const TIM1: u32 = 0x4001_2C00;
const USART1: u32 = 0x4001_3800;
const RCC: u32 = 0x4002_1000;
const FLASH_ACR: u32 = 0x4002_2000;
const NVIC: u32 = 0xE000_E000;

// Offsets in a port (RM0008 9.2) and in the NVIC (PM0056 4.3).
const CRL: u16 = 0x00;
const CRH: u16 = 0x04;
const ODR: u16 = 0x0C;
const ISER: u16 = 0x100;
const ICER: u16 = 0x180;

/// Base address of a block, compared bits, and offsets of its registers. A mask is extended by its highest bit.
const TABLE: [(u32, i16, &[u16]); 22] = [
    // CFGR, APB2RSTR, APB1RSTR, AHBENR, APB2ENR, APB1ENR (RM0008 7.3).
    (RCC, ALL, &[0x04, 0x0C, 0x10, 0x14, 0x18, 0x1C]),
    // The pulls of the slots' lines and of RX.
    (GPIOA, 0x4FF, &[ODR]),
    (GPIOB, 0x003, &[ODR]),
    (GPIOC, 0x03F, &[ODR]),
    // The modes, without those of PB6 and PB7 and of the pins between PB2 and PB6, which are no outputs.
    (GPIOB, 0xFFF, &[CRL]),
    (GPIOB, ALL, &[CRH]),
    (GPIOA, ALL, &[CRL]),
    (GPIOA, !0xFFF, &[CRH]),
    (GPIOC, ALL, &[CRL, CRH]),
    // Enables, and priorities of EXTI0 to EXTI4, TIM1_CC, TIM2, TIM4, USART1 and USART3 (RM0008 table 63).
    (
        NVIC,
        ALL,
        &[ISER, ISER + 4, 0x404, 0x408, 0x418, 0x41C, 0x424],
    ),
    // Wait states and prefetch, without its status (PM0075 3.1).
    (FLASH_ACR, 0x1F, &[0]),
    // MAPR, without the debug port (RM0008 9.4.2).
    (AFIO, 0x7FFF, &[0x04]),
    // CR1, SMCR, DIER, PSC, ARR (RM0008 15.4).
    (TIM4, ALL, &[0x00, 0x08, 0x0C, 0x28, 0x2C]),
    // CR1 without TXEIE, BRR, CR2, CR3 (RM0008 27.6).
    (USART3, !(1 << 7), &[0x0C]),
    (USART3, ALL, &[0x08, 0x10, 0x14]),
    // The line: BRR, CR1, CR2, CR3. The modes of PA8 to PA10.
    (USART1, ALL, &[0x08, 0x0C, 0x10, 0x14]),
    (GPIOA, 0xFFF, &[CRH]),
    // CR1 without CEN, DIER without CC2IE, SMCR, CCMR1, CCMR2, CCER, PSC, ARR, CCR1, CCR2, CCR3.
    (TIM2, !1, &[0x00]),
    (TIM2, !(1 << 2), &[0x0C]),
    (
        TIM2,
        ALL,
        &[0x08, 0x18, 0x1C, 0x20, 0x28, 0x2C, 0x34, 0x38, 0x3C],
    ),
    // DIER without CC1IE and CC2IE, CR1, SMCR, CCMR1, CCMR2, CCER, PSC, ARR (RM0008 14.4).
    (TIM1, !(0b11 << 1), &[0x0C]),
    (TIM1, ALL, &[0x00, 0x08, 0x18, 0x1C, 0x20, 0x28, 0x2C]),
];
const ALL: i16 = -1;

/// Number of clock and reset registers, the first rows.
const CLOCKS: usize = 6;
// Positions of rows: after the pulls, and the first of each block.
const MODES: usize = 9;
const SCAN_TIMER: usize = 24;
const RADIO: usize = 29;
const LINE: usize = 33;
const ROWS: usize = 57;
/// Number of milliseconds after which every row of the line has been checked, one in each.
const LINE_MS: usize = ROWS - LINE;
/// Number of rows outside the line.
const ROUND: u8 = LINE as u8;

/// Bits 2 to 17 of the address and the compared bits of every row. The peripherals do not use the range of bits 2 to
/// 17 in which the NVIC lies.
const PLACES: [(u16, i16); ROWS] = {
    let mut places = [(0, 0); ROWS];
    let (mut row, mut block) = (0, 0);
    while block < TABLE.len() {
        let (base, mask, offsets) = TABLE[block];
        let mut n = 0;
        while n < offsets.len() {
            places[row] = (((base + offsets[n] as u32) >> 2) as u16, mask);
            (row, n) = (row + 1, n + 1);
        }
        block += 1;
    }
    assert!(row == ROWS);
    places
};

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
        bus.write(address, bus.read(address) & !self.mask() | self.expected);
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
    /// Records the present settings. The line and the radio are compared only when they are in use. Call this when
    /// everything is set up and the scan timer runs.
    pub fn record(bus: &impl Bus, line: bool, radio: bool) -> Self {
        const NOTHING: Row = Row {
            place: (FLASH_ACR >> 2) as u16,
            mask: 0,
            expected: 0,
        };
        let mut rows = [NOTHING; ROWS];
        for (n, (row, (place, mask))) in rows.iter_mut().zip(PLACES).enumerate() {
            // A block that is not in use may have no clock.
            if n < RADIO || n >= LINE && line || n < LINE && radio {
                (row.place, row.mask) = (place, mask);
                if (CLOCKS..MODES).contains(&n) {
                    row.mask &= pulled(bus, row.address() - u32::from(ODR));
                }
                if !line && row.address() == GPIOA + u32::from(CRH) {
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
        } else if wrong >= RADIO {
            return Wrong::Radio;
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

    use super::*;

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
        memory.0.insert(GPIOA, 0x3333_3338);
        memory.0.insert(APB1ENR, 0x5555_5555);
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
                RADIO.. => (Wrong::Radio, ROUND),
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
        memory.0.insert(USART1 + 0x0C, 0);
        for _ in 0..ROUND {
            assert_eq!(registers.check(&mut memory, true, true), None);
        }
        assert_eq!(
            run(&mut registers, &mut memory, LINE_MS as u8),
            [Wrong::Line]
        );
        memory.0.insert(USART3 + 0x0C, 0);
        assert_eq!(run(&mut unused, &mut memory, ROUND), []);
    }
}
