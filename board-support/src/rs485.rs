//! The RS-485 line: the board's UART and the driver enable of its transceiver.
//!
//! The line is half duplex. While the unit sends, its receiver is off, so that it does not receive its own bytes
//! even when the transceiver's receiver stays enabled. Each method serves one interrupt in a few instructions:
//! [`Uart::status`] is read once and gives the reason for the interrupt.

use stm32f1xx_hal::pac::{self, usart1::RegisterBlock};

use crate::{
    ClockSource,
    baud_rate::divider,
    boards::BOARD,
    pin::{Mode, Pin},
    usart::Usart,
};
use ports::{
    line::{Character, Uart},
    line_settings::{Format, LineSettings},
};

/// The UART's flags and interrupt enables, as [`Uart::status`] read them.
#[derive(Clone, Copy)]
pub struct Status {
    flags: u16,
    /// CR1, whose interrupt enable bits have the same positions as their flags (RM0008 27.6.1, 27.6.4).
    enables: u16,
}

/// PE, FE and ORE, at the bit positions of [`Character::faults`].
const FAULTS: u16 = 0b1011;
const ORE: u16 = 1 << 3;
const RXNE: u16 = 1 << 5;
const TC: u16 = 1 << 6;
const TXE: u16 = 1 << 7;

const UART: Usart = BOARD.line.uart;
/// Driver enable of the transceiver.
const DRIVER: Pin = BOARD.line.driver;

/// Configures the pins of the line so that nothing is sent: the driver is off, and TX still floats.
pub(crate) fn set_up_pins() {
    disable_driver();
    // 10 MHz gives a rise time of 25 ns (DS5319 table 37), which is 1/40 of a bit at 921600 bit/s.
    DRIVER.configure(Mode::FastOutput);
    UART.rx().pull_up();
}

/// The modes of those pins of the line that are in one configuration register.
struct Modes {
    register: Pin,
    mask: u32,
    bits: u32,
}

impl Modes {
    const OF_UART: Self = Self::beside(UART.tx());
    const OF_DRIVER: Self = Self::beside(DRIVER);

    /// Returns the modes in the register of a pin: the driver enable is an output and TX one of the UART, both at 10 MHz,
    /// RX is an input with pull-up (RM0008 table 20).
    const fn beside(register: Pin) -> Self {
        let pins = [
            (DRIVER, Mode::FastOutput),
            (UART.tx(), Mode::FastPeripheral),
            (UART.rx(), Mode::Pulled),
        ];
        let mask = BOARD.line.mode_bits(register.mode_register());
        let (mut bits, mut n) = (0, 0);
        while n < pins.len() {
            let (pin, mode) = pins[n];
            // Repeated for each pin of the register.
            let modes = mode as u32 * 0x1111_1111;
            if pin.mode_register() == register.mode_register() {
                bits |= pin.mode_bits() & modes;
            }
            n += 1;
        }
        Self {
            register,
            mask,
            bits,
        }
    }

    #[inline(always)]
    fn set(&self) {
        self.register.change_modes(self.mask, self.bits);
    }
}

/// Turns the driver off.
#[inline(always)]
pub fn disable_driver() {
    DRIVER.set(false);
}

/// The line in use.
pub struct Rs485 {
    divider: u16,
    format: Format,
    /// CR1 as it is written. It is computed once, because the compiler may make the match of [`receiving`] a table in
    /// flash, and [`Rs485::set_up`] also runs during a flash operation.
    receiving: u16,
    /// [`Format::stop_in_data`] of the line's format, to be set in every byte.
    stop_in_data: u8,
}

/// Returns CR1 for receiving in this format: the line's settings with UE, TE, RE and RXNEIE (RM0008 27.6.4).
const fn receiving(format: Format) -> u16 {
    const UE: u16 = 1 << 13;
    const M: u16 = 1 << 12;
    const PCE: u16 = 1 << 10;
    const PS: u16 = 1 << 9;
    const TE: u16 = 1 << 3;
    const RE: u16 = 1 << 2;
    const RXNEIE: u16 = 1 << 5;
    // The parity bit is the last bit of the word; with M set a word has nine bits (RM0008 27.3.7).
    let format = match format {
        Format::N2 | Format::N1 | Format::SevenN2 => 0,
        Format::E1 => M | PCE,
        Format::O1 => M | PCE | PS,
        Format::SevenE1 => PCE,
        Format::SevenO1 => PCE | PS,
    };
    UE | TE | RE | RXNEIE | format
}

/// Returns CR2, for one or two stop bits. In 7N2 the first stop bit is a data bit, [`Format::stop_in_data`].
const fn stop_bits(format: Format) -> u16 {
    match format {
        Format::N2 => 0b10 << 12,
        _ => 0,
    }
}

impl Rs485 {
    /// Sets the line up and turns the receiver on. Returns `None` when this clock cannot produce the rate; the line
    /// then stays off.
    pub(crate) fn new(
        settings: LineSettings,
        clock: ClockSource,
        rcc: &mut pac::RCC,
    ) -> Option<Self> {
        let divider = divider(UART.hz(clock), settings.baud)?;
        UART.enable(rcc);
        let mut line = Self {
            divider,
            format: settings.format,
            receiving: receiving(settings.format),
            stop_in_data: settings.format.stop_in_data(),
        };
        line.set_up();
        Some(line)
    }

    #[inline(always)]
    const fn usart(&self) -> &RegisterBlock {
        UART.registers()
    }

    /// The UART replaces the highest bit by the parity bit (RM0008 27.6.2).
    #[inline]
    fn write(&self, byte: u8) {
        let word = byte | self.stop_in_data;
        self.usart().dr().write(|w| w.dr().set(u16::from(word)));
    }
}

impl Uart for Rs485 {
    type Status = Status;

    #[inline]
    fn received(status: Status) -> bool {
        status.flags & (RXNE | ORE) != 0
    }

    #[inline]
    fn wants_byte(status: Status) -> bool {
        status.flags & status.enables & TXE != 0
    }

    #[inline]
    fn sent(status: Status) -> bool {
        status.flags & status.enables & TC != 0
    }

    /// A character under way is lost.
    fn set_up(&mut self) {
        disable_driver();
        let usart = self.usart();
        usart.cr1().reset();
        usart.cr3().reset();
        usart.gtpr().reset();
        // SAFETY: every value written here has 0 in the reserved bits of these registers (RM0008 27.6).
        unsafe {
            usart.brr().write(|w| w.bits(self.divider));
            usart.cr2().write(|w| w.bits(stop_bits(self.format)));
            usart.cr1().write(|w| w.bits(self.receiving));
        }
        // The transmitter is on and drives high before TX becomes its output.
        Modes::OF_UART.set();
        if DRIVER.mode_register() != UART.tx().mode_register() {
            Modes::OF_DRIVER.set();
        }
        // Discard what was received before, including its error flags; it is not part of the next frame.
        let _ = (usart.sr().read(), usart.dr().read());
    }

    #[inline]
    fn disable_other_interrupts(&mut self) -> bool {
        /// IDLEIE and PEIE.
        const OTHERS: u16 = 1 << 4 | 1 << 8;
        let settings = self.usart().cr1().read().bits();
        // SAFETY: clears bits of the present settings.
        self.usart()
            .cr1()
            .write(|w| unsafe { w.bits(settings & !OTHERS) });
        settings & OTHERS != 0
    }

    #[inline]
    fn driver_is_off(&self) -> bool {
        !DRIVER.is_set()
    }

    #[inline]
    fn status(&self) -> Status {
        Status {
            flags: self.usart().sr().read().bits(),
            enables: self.usart().cr1().read().bits(),
        }
    }

    #[inline]
    fn read(&mut self, status: Status) -> Character {
        Character {
            // With words of nine bits, the ninth is the parity bit.
            byte: self.usart().dr().read().bits() as u8,
            faults: (status.flags & FAULTS) as u8,
        }
    }

    // The first byte of a reply must not wait for a call.
    #[inline(always)]
    fn start_sending(&mut self, first: u8) {
        DRIVER.set(true);
        // Reading SR and then writing DR clears TC (RM0008 27.6.1).
        let _ = self.usart().sr().read();
        self.write(first);
        self.usart()
            .cr1()
            .modify(|_, w| w.re().disabled().rxneie().disabled().txeie().enabled());
    }

    #[inline]
    fn send(&mut self, byte: u8) {
        self.write(byte);
        // When this runs late, the previous byte may end between the read of SR and the write to DR, which then
        // does not clear TC (RM0008 27.6.1). This byte cannot have ended yet, so a TC that is set belongs to the
        // previous one. It would switch the driver off too early.
        if self.usart().sr().read().tc().bit_is_set() {
            // SAFETY: writing 1 leaves the other flags of SR unchanged, or they cannot be written.
            self.usart().sr().write(|w| unsafe { w.bits(!TC) });
        }
    }

    #[inline]
    fn finish_sending(&mut self) {
        self.usart()
            .cr1()
            .modify(|_, w| w.txeie().disabled().tcie().enabled());
    }

    #[inline]
    fn stop_sending(&mut self) {
        disable_driver();
        self.usart()
            .cr1()
            .modify(|_, w| w.tcie().disabled().re().enabled().rxneie().enabled());
    }
}
