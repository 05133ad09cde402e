//! The UART of the second line, at 9600 8N1, and the pins M0, M1 and AUX of a radio.
//!
//! [`SecondUart::on_interrupt`] moves one byte in each direction. It runs from RAM, so that no byte is lost while flash
//! is erased or programmed.

use stm32f1xx_hal::pac;

use crate::{
    ClockSource, IoPin,
    baud_rate::divider,
    boards::{BOARD, RadioPins, SecondPins},
    fitted::{self, Fitted},
    pin::Mode,
    usart::Usart,
};
use ports::line_settings::LineSettings;

/// The UART. Without a second line there is no proof of one, so this is never used.
const UART: Usart = match BOARD.second {
    Some(SecondPins { uart, .. }) => uart,
    None => Usart::Usart3,
};

const FE: u16 = 1 << 1;
const ORE: u16 = 1 << 3;
const RXNE: u16 = 1 << 5;
const TXE: u16 = 1 << 7;

/// CR1: UE, TE, RE and RXNEIE; words of eight bits without parity (RM0008 27.6.4).
const RECEIVING: u16 = 1 << 13 | 1 << 3 | 1 << 2 | 1 << 5;

/// The second line before it is set up.
pub struct SecondOff {
    pub(crate) clock: ClockSource,
}

/// The UART.
pub struct SecondUart {
    divider: u16,
    _fitted: Proof,
}

/// The pins of a radio, set up.
pub struct RadioIo {
    /// M0 and M1.
    pub mode: [IoPin; 2],
    /// AUX.
    pub aux: IoPin,
}

/// Proof that the board has a second line.
pub type Proof = <fitted::Second as Fitted>::Proof;

/// Error for a byte that was received damaged, or lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Damaged;

impl SecondOff {
    /// Sets up the UART. Returns also the proof that the board has a second line. Returns `None` when it has none, or the
    /// clock cannot produce the baud rate; the line then stays off.
    #[must_use]
    pub fn start(self, rcc: &mut pac::RCC) -> Option<(SecondUart, Proof)> {
        let proof = fitted::Second::proof()?;
        let divider = divider(UART.hz(self.clock), LineSettings::SECOND.baud)?;
        UART.enable(rcc);
        let mut uart = SecondUart {
            divider,
            _fitted: proof,
        };
        uart.set_up();
        // The transmitter is on and drives high before the pin becomes its output.
        UART.tx().configure(Mode::Peripheral);
        UART.rx().pull_up();
        Some((uart, proof))
    }
}

impl RadioIo {
    /// Sets up the pins of a radio: M0 and M1, which are high as the module pulls them, so that it is asleep until it has
    /// its settings, and AUX, which is pulled up. Returns `None` when the second line is no radio.
    #[must_use]
    #[inline(always)]
    pub fn start() -> Option<Self> {
        let RadioPins {
            mode: [m0, m1],
            aux,
        } = BOARD.second?.radio?;
        Some(Self {
            mode: [IoPin::high(m0), IoPin::high(m1)],
            aux: IoPin::pulled_up(aux),
        })
    }
}

impl SecondUart {
    /// Sets every register of the UART up. A byte under way is lost. Runs from RAM, because a disturbed UART is set
    /// up again while flash may be busy.
    #[inline(never)]
    #[unsafe(link_section = ".ram_code")]
    pub fn set_up(&mut self) {
        let usart = UART.registers();
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
        let usart = UART.registers();
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
