//! Which registers are compared: the table, which follows from the board's descriptor.

use crate::{
    boards::{BOARD, RadioPins, SecondPins},
    pin::{Pin, Port},
};

pub(super) const PERIPHERALS: u32 = 0x4000_0000;
// Base addresses (RM0008 table 3, PM0056 4.3).
pub(super) const TIM2: u32 = 0x4000_0000;
const TIM4: u32 = 0x4000_0800;
const AFIO: u32 = 0x4001_0000;
pub(super) const MAPR: u32 = AFIO + 0x04;
const EXTI: u32 = 0x4001_0400;
const TIM1: u32 = 0x4001_2C00;
pub(super) const RCC: u32 = 0x4002_1000;
pub(super) const FLASH_ACR: u32 = 0x4002_2000;
pub(super) const NVIC: u32 = 0xE000_E000;

// Offsets in a port (RM0008 9.2) and in the NVIC (PM0056 4.3).
const CRL: u32 = 0x00;
const CRH: u32 = 0x04;
pub(super) const ODR: u16 = 0x0C;
pub(super) const ISER: u16 = 0x100;
pub(super) const ICER: u16 = 0x180;
const IPR: u16 = 0x400;

/// Base address of a block, compared bits, and offsets of its registers. A mask is extended by its highest bit.
type Block = (u32, i16, &'static [u16]);
pub(super) const ALL: i16 = -1;
/// No register.
const NONE: &[u16] = &[];

pub(super) const UART: u32 = BOARD.line.uart.base();
/// The UART of the second line, if there is one.
pub(super) const SECOND_UART: u32 = match BOARD.second {
    Some(SecondPins { uart, .. }) => uart.base(),
    None => UART,
};
/// The configuration register of TX and RX, and that of the driver enable.
pub(super) const UART_MODES: u32 = BOARD.line.uart.tx().mode_register();
pub(super) const DRIVER_MODES: u32 = BOARD.line.driver.mode_register();
/// The pin whose edges raise an interrupt, if no timer captures them.
const EDGE: Option<Pin> = BOARD.line.edge();

/// Returns the registers of the second line's UART at these offsets, if there is one.
const fn second(offsets: &'static [u16]) -> &'static [u16] {
    if BOARD.second.is_some() {
        offsets
    } else {
        NONE
    }
}

/// Returns the pulls of a port. The radio changes that of AUX.
const fn pulls(port: Port) -> Block {
    let changes = match BOARD.second {
        Some(SecondPins {
            radio: Some(RadioPins { aux, .. }),
            ..
        }) if aux.port() as u8 == port as u8 => 1 << aux.number(),
        _ => 0,
    };
    if is_used(port) {
        (port.base(), !changes, &[ODR])
    } else {
        (port.base(), 0, NONE)
    }
}

const fn is_used(port: Port) -> bool {
    port as u8 <= BOARD.last_port as u8
}

/// Returns the modes in a configuration register of a port, without those that [`line_modes`] has. On a board with DACs,
/// PB6 and PB7 are without the pins between them and PB2, too, which are no outputs.
const fn modes(port: Port, offset: u32) -> Block {
    let register = port.base() + offset;
    if !is_used(port) {
        return (register, 0, NONE);
    }
    let mask = match line_mask(register) {
        Some(mask) => !mask,
        None if BOARD.has_slots() && register == Port::B.base() => 0xFFF,
        None => ALL,
    };
    (register, mask, &[0])
}

/// Returns the modes of the line's pins in a configuration register, if they have a mask.
const fn line_modes(register: u32) -> Block {
    match line_mask(register) {
        Some(mask) => (register, mask, &[0]),
        None => (register, 0, NONE),
    }
}

/// Returns the mask of the line's pins in a configuration register. `None` when no pin of the line is in the register, or
/// when the bits do not fit a mask of 16 bits. In the second case [`modes`] repairs these pins with the others.
const fn line_mask(register: u32) -> Option<i16> {
    let bits = BOARD.line.mode_bits(register);
    let mask = bits as i16;
    if bits != 0 && mask as u32 == bits {
        Some(mask)
    } else {
        None
    }
}

/// Priorities of EXTI0 to EXTI4, TIM1_CC, TIM2, TIM4 and USART1 to USART3, four in each register (RM0008 table 63).
const PRIORITIES: [u16; 5] = [IPR + 4, IPR + 8, IPR + 24, IPR + 28, IPR + 36];

/// Returns the register with the priority of an interrupt, unless [`PRIORITIES`] has it.
const fn priority(interrupt: u16) -> Block {
    let register = IPR + interrupt / 4 * 4;
    let mut n = 0;
    while n < PRIORITIES.len() {
        if PRIORITIES[n] == register {
            return (NVIC, 0, NONE);
        }
        n += 1;
    }
    (NVIC + register as u32, ALL, &[0])
}

/// Returns the compared bits of a register with 32 interrupt enables. That of the line's edges changes in operation.
const fn enables(register: u16) -> i16 {
    match EDGE {
        Some(pin) if pin.edge_interrupt() / 32 == register => {
            let bit = pin.edge_interrupt() % 32;
            assert!(bit < 15, "the mask has no bit for this interrupt alone");
            !(1 << bit)
        }
        _ => ALL,
    }
}

/// The registers in groups: clocks and resets, pulls, others that are written, scan timer, second line, line.
const GROUPS: [&[Block]; 6] = [
    // CFGR, APB2RSTR, APB1RSTR, AHBENR, APB2ENR, APB1ENR (RM0008 7.3).
    &[(RCC, ALL, &[0x04, 0x0C, 0x10, 0x14, 0x18, 0x1C])],
    &[
        pulls(Port::A),
        pulls(Port::B),
        pulls(Port::C),
        pulls(Port::D),
        pulls(Port::E),
    ],
    &[
        modes(Port::A, CRL),
        modes(Port::A, CRH),
        modes(Port::B, CRL),
        modes(Port::B, CRH),
        modes(Port::C, CRL),
        modes(Port::C, CRH),
        modes(Port::D, CRL),
        modes(Port::D, CRH),
        modes(Port::E, CRL),
        modes(Port::E, CRH),
        (NVIC, enables(0), &[ISER]),
        (NVIC, enables(1), &[ISER + 4]),
        (NVIC, ALL, &PRIORITIES),
        priority(BOARD.line.uart.interrupt()),
        priority(match EDGE {
            Some(pin) => pin.edge_interrupt(),
            None => BOARD.line.uart.interrupt(),
        }),
        // Wait states and prefetch, without its status (PM0075 3.1).
        (FLASH_ACR, 0x1F, &[0]),
        // MAPR, without the debug port, whose setting cannot be read (RM0008 9.4.2).
        (MAPR, 0x7FFF, &[0]),
    ],
    // CR1, SMCR, DIER, PSC, ARR (RM0008 15.4).
    &[(TIM4, ALL, &[0x00, 0x08, 0x0C, 0x28, 0x2C])],
    &[
        // CR1 without TXEIE, BRR, CR2, CR3 (RM0008 27.6).
        (SECOND_UART, !(1 << 7), second(&[0x0C])),
        (SECOND_UART, ALL, second(&[0x08, 0x10, 0x14])),
    ],
    &[
        // BRR, CR1, CR2, CR3.
        (UART, ALL, &[0x08, 0x0C, 0x10, 0x14]),
        line_modes(UART_MODES),
        line_modes(if DRIVER_MODES == UART_MODES {
            0
        } else {
            DRIVER_MODES
        }),
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
        // IMR, RTSR, FTSR (RM0008 10.3), and the port of the line.
        (
            EXTI,
            ALL,
            if EDGE.is_some() {
                &[0x00, 0x08, 0x0C]
            } else {
                NONE
            },
        ),
        (
            AFIO,
            ALL,
            match EDGE {
                Some(pin) => &[0x08 + pin.number() as u16 / 4 * 4],
                None => NONE,
            },
        ),
    ],
];

/// Returns the number of registers in the first groups.
const fn rows(groups: usize) -> usize {
    let (mut rows, mut group) = (0, 0);
    while group < groups {
        let mut block = 0;
        while block < GROUPS[group].len() {
            rows += GROUPS[group][block].2.len();
            block += 1;
        }
        group += 1;
    }
    rows
}

/// Number of clock and reset registers, the first rows.
pub(super) const CLOCKS: usize = rows(1);
// Positions of rows: after the pulls, and the first of each block.
pub(super) const MODES: usize = rows(2);
pub(super) const SCAN_TIMER: usize = rows(3);
pub(super) const SECOND: usize = rows(4);
pub(super) const LINE: usize = rows(5);
pub(super) const ROWS: usize = rows(GROUPS.len());

/// Bits 2 to 17 of the address and the compared bits of every row. The peripherals do not use the range of bits 2 to
/// 17 in which the NVIC lies.
pub(super) const PLACES: [(u16, i16); ROWS] = {
    let mut places = [(0, 0); ROWS];
    let (mut row, mut group) = (0, 0);
    while group < GROUPS.len() {
        let mut block = 0;
        while block < GROUPS[group].len() {
            let (base, mask, offsets) = GROUPS[group][block];
            let mut n = 0;
            while n < offsets.len() {
                places[row] = (((base + offsets[n] as u32) >> 2) as u16, mask);
                (row, n) = (row + 1, n + 1);
            }
            block += 1;
        }
        group += 1;
    }
    assert!(row == ROWS);
    places
};
