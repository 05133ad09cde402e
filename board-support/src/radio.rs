//! The radio's UART, USART3 on PB10 and PB11 at 9600 8N1, and its pins M0, M1 and AUX.
//!
//! [`RadioUart::on_interrupt`] moves one byte in each direction. It runs from RAM, so that no byte is lost while flash
//! is erased or programmed.

use stm32f1xx_hal::{
    pac,
    rcc::{Enable, Reset},
};

use crate::{
    ClockSource, IoPin,
    boards::BOARD,
    fitted::{self, Fitted},
    pin::{Mode, Pin},
    uart::divider,
};

/// Baud rate of the radio module. In sleep mode it has no other.
const BAUD: u32 = 9600;

const FE: u16 = 1 << 1;
const ORE: u16 = 1 << 3;
const RXNE: u16 = 1 << 5;
const TXE: u16 = 1 << 7;

/// CR1: UE, TE, RE and RXNEIE; words of eight bits without parity (RM0008 27.6.4).
const RECEIVING: u16 = 1 << 13 | 1 << 3 | 1 << 2 | 1 << 5;

/// The radio before it is set up.
pub struct RadioOff {
    pub(crate) usart: pac::USART3,
    pub(crate) clock: ClockSource,
}

/// The UART.
pub struct RadioUart {
    usart: pac::USART3,
    divider: u16,
    _fitted: Proof,
}

/// Proof that the board has a radio.
pub type Proof = <fitted::Radio as Fitted>::Proof;

/// A byte from the radio, or a damaged or lost one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Damaged;

impl RadioOff {
    /// Sets up the UART and the pins: M0 and M1, which are high as the module pulls them, so that it is asleep until it
    /// has its settings, and AUX, which is pulled up. Returns also the proof that the board has a radio.
    /// Returns `None` when the board has no radio, or the clock cannot produce the baud rate; the radio then stays off.
    #[must_use]
    pub fn start(self, rcc: &mut pac::RCC) -> Option<(RadioUart, [IoPin; 2], IoPin, Proof)> {
        let (pins, proof) = (BOARD.radio?, fitted::Radio::proof()?);
        let divider = divider(self.clock.apb1_hz(), BAUD)?;
        pac::USART3::enable(rcc);
        pac::USART3::reset(rcc);
        let mut uart = RadioUart {
            usart: self.usart,
            divider,
            _fitted: proof,
        };
        uart.set_up();
        // The transmitter is on and drives high before the pin becomes its output.
        Pin::b(10).configure(Mode::Peripheral);
        Pin::b(11).pull_up();
        let [m0, m1] = pins.mode;
        let mode = [IoPin::high(m0), IoPin::high(m1)];
        Some((uart, mode, IoPin::pulled_up(pins.aux), proof))
    }
}

impl RadioUart {
    /// Sets every register of the UART up. A byte under way is lost. Runs from RAM, because a disturbed UART is set
    /// up again while flash may be busy.
    #[inline(never)]
    #[unsafe(link_section = ".ram_code")]
    pub fn set_up(&mut self) {
        let usart = &self.usart;
        usart.cr1().reset();
        usart.cr3().reset();
        usart.cr2().reset();
        // SAFETY: every value written here has 0 in the reserved bits of these registers (RM0008 27.6).
        unsafe {
            usart.brr().write(|w| w.bits(self.divider));
            usart.cr1().write(|w| w.bits(RECEIVING));
        }
    }

    /// Handles the UART's interrupt, whatever its cause: passes a received byte to `received`, and sends the next
    /// byte from `next` when the UART can take one. While `next` returns `None`, the UART raises no interrupt for
    /// it; pend the interrupt when there is a byte again.
    #[inline(always)]
    pub fn on_interrupt(
        &mut self,
        received: impl FnOnce(Result<u8, Damaged>),
        next: impl FnOnce() -> Option<u8>,
    ) {
        let usart = &self.usart;
        let flags = usart.sr().read().bits();
        if flags & (RXNE | ORE) != 0 {
            let byte = usart.dr().read().bits() as u8;
            received(if flags & (FE | ORE) == 0 {
                Ok(byte)
            } else {
                Err(Damaged)
            });
        }
        if flags & TXE != 0 {
            let byte = next();
            if let Some(byte) = byte {
                usart.dr().write(|w| w.dr().set(byte.into()));
            }
            usart.cr1().modify(|_, w| w.txeie().bit(byte.is_some()));
        }
    }
}
