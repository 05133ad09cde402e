//! The RS-485 line: USART1 with its transceiver's driver enable.
//!
//! Half duplex: while the unit sends, its receiver is off, so that it cannot take its own bytes for a
//! request even where the transceiver's receiver stays on. The methods are what one interrupt needs,
//! each a few instructions: [`Rs485::status`] is read once and says what the interrupt is about.

use stm32f1xx_hal::{
    gpio::{Input, Output, PA8, PA10, PinState, PullUp, PushPull},
    pac,
    rcc::{Enable, Reset},
};

use crate::{
    ClockSource,
    signature::Signature,
    uart::{Format, LineSettings, divider},
};

/// What the UART wants, as it was when [`Rs485::status`] read it.
#[derive(Clone, Copy)]
pub struct Status {
    flags: u16,
    /// CR1, whose interrupt enables stand at the places of their flags (RM0008 27.6.1, 27.6.4).
    enables: u16,
}

/// A character from the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Character {
    /// Its eight data bits; with seven of them, bit 7 is the parity bit or the first stop bit.
    pub byte: u8,
    /// What was wrong with it: bit 0 parity, bit 1 framing (the stop bit was low), bit 3 overrun (a
    /// character after it was lost). Never bit 2, noise, which is samples of a bit that disagreed:
    /// the majority decides, and the check of the frame finds out whether it was right.
    pub faults: u8,
}

/// PE, FE and ORE: as [`Character::faults`] has them.
const FAULTS: u16 = 0b1011;
const ORE: u16 = 1 << 3;
const RXNE: u16 = 1 << 5;
const TC: u16 = 1 << 6;
const TXE: u16 = 1 << 7;

impl Status {
    /// A character is waiting to be [`read`](Rs485::read), or was lost.
    #[must_use]
    pub const fn received(self) -> bool {
        self.flags & (RXNE | ORE) != 0
    }

    /// The next byte can be [sent](Rs485::send), and one is wanted.
    #[must_use]
    pub const fn wants_byte(self) -> bool {
        self.flags & self.enables & TXE != 0
    }

    /// The last stop bit has left the unit.
    #[must_use]
    pub const fn sent(self) -> bool {
        self.flags & self.enables & TC != 0
    }
}

/// The pins of the line, before it is set up.
pub(crate) struct Pins {
    pub(crate) driver: PA8<Output<PushPull>>,
    pub(crate) tx: stm32f1xx_hal::gpio::PA9,
    pub(crate) rx: PA10<Input<PullUp>>,
    pub(crate) cr: stm32f1xx_hal::gpio::Cr<'A', true>,
}

/// The line in use.
pub struct Rs485 {
    usart: pac::USART1,
    driver: PA8<Output<PushPull>>,
    divider: u16,
    format: Format,
    /// [`Format::stop_in_data`], ready for every byte.
    stop_in_data: u8,
    /// What CR1 read after it was set, and the signature of the other registers. They are compared with what they
    /// read, not with what was written: an emulator need not keep every bit.
    cr1: u16,
    set: Signature,
}

/// CR1 of a receiver: the line's settings, with UE, TE, RE and RXNEIE (RM0008 27.6.4).
const fn receiving(format: Format) -> u16 {
    const UE: u16 = 1 << 13;
    const M: u16 = 1 << 12;
    const PCE: u16 = 1 << 10;
    const PS: u16 = 1 << 9;
    const TE: u16 = 1 << 3;
    const RE: u16 = 1 << 2;
    const RXNEIE: u16 = 1 << 5;
    // A parity bit is the last bit of the word, which has nine bits with M (RM0008 27.3.7).
    let format = match format {
        Format::N2 | Format::N1 | Format::SevenN2 => 0,
        Format::E1 => M | PCE,
        Format::O1 => M | PCE | PS,
        Format::SevenE1 => PCE,
        Format::SevenO1 => PCE | PS,
    };
    UE | TE | RE | RXNEIE | format
}

/// CR2: two stop bits, or one. The first one of 7N2 is a data bit, [`Format::stop_in_data`].
const fn stop_bits(format: Format) -> u16 {
    match format {
        Format::N2 => 0b10 << 12,
        _ => 0,
    }
}

impl Rs485 {
    /// Sets the line up and turns the receiver on. `None` when the rate cannot be had from this
    /// clock; the line then stays off.
    pub(crate) fn new(
        usart: pac::USART1,
        mut pins: Pins,
        settings: LineSettings,
        clock: ClockSource,
        rcc: &mut pac::RCC,
    ) -> Option<Self> {
        let divider = divider(clock.core_hz(), settings.baud)?;
        pac::USART1::enable(rcc);
        pac::USART1::reset(rcc);
        let mut line = Self {
            usart,
            driver: pins.driver,
            divider,
            format: settings.format,
            stop_in_data: settings.format.stop_in_data(),
            cr1: 0,
            set: Signature::default(),
        };
        line.set_up();
        // The transmitter is on and idles high before the pin becomes its output.
        let _tx = pins.tx.into_alternate_push_pull(&mut pins.cr);
        let _rx = pins.rx;
        Some(line)
    }

    /// Turns the driver off, sets every register of the UART, and listens. A character under way is lost.
    pub fn set_up(&mut self) {
        self.driver.set_state(PinState::Low);
        let usart = &self.usart;
        usart.cr1().reset();
        usart.cr3().reset();
        usart.gtpr().reset();
        // SAFETY: the reserved bits of these registers are 0 in every value written here (RM0008 27.6).
        unsafe {
            usart.brr().write(|w| w.bits(self.divider));
            usart.cr2().write(|w| w.bits(stop_bits(self.format)));
            usart.cr1().write(|w| w.bits(receiving(self.format)));
        }
        // What was received or damaged before is not the next frame's.
        let _ = (usart.sr().read(), usart.dr().read());
        self.cr1 = usart.cr1().read().bits();
        self.set = self.settings();
    }

    /// The signature of CR2, CR3 and BRR.
    fn settings(&self) -> Signature {
        let usart = &self.usart;
        Signature::default()
            .with(usart.cr2().read().bits().into())
            .with(usart.cr3().read().bits().into())
            .with(usart.brr().read().bits().into())
    }

    /// Whether every register of the UART is as it was set up and the driver is off, while nothing is being sent.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.usart.cr1().read().bits() == self.cr1
            && self.settings() == self.set
            && self.driver.is_set_low()
    }

    /// What the UART wants.
    #[inline]
    #[must_use]
    pub fn status(&self) -> Status {
        Status {
            flags: self.usart.sr().read().bits(),
            enables: self.usart.cr1().read().bits(),
        }
    }

    /// Takes the character that [`Status::received`] told of.
    #[inline]
    pub fn read(&mut self, status: Status) -> Character {
        Character {
            // With nine bits, the ninth is the parity bit.
            byte: self.usart.dr().read().bits() as u8,
            faults: (status.flags & FAULTS) as u8,
        }
    }

    /// Turns the driver on and sends the first byte of a response, with the receiver off.
    pub fn start_sending(&mut self, first: u8) {
        self.driver.set_state(PinState::High);
        // Reading SR and then writing DR takes TC back (RM0008 27.6.1).
        let _ = self.usart.sr().read();
        self.write(first);
        self.usart
            .cr1()
            .modify(|_, w| w.re().disabled().rxneie().disabled().txeie().enabled());
    }

    /// A parity bit takes the place of the highest bit (RM0008 27.6.2).
    #[inline]
    fn write(&self, byte: u8) {
        let word = byte | self.stop_in_data;
        self.usart.dr().write(|w| w.dr().set(u16::from(word)));
    }

    /// Sends the next byte.
    #[inline]
    pub fn send(&mut self, byte: u8) {
        self.write(byte);
        // When this comes late, the byte before may end between the reading of SR and this write, which then does
        // not clear TC (RM0008 27.6.1). This byte cannot have ended yet: a TC that is set is not its own, and
        // would switch the driver off too early.
        if self.usart.sr().read().tc().bit_is_set() {
            // SAFETY: the other flags of SR are left alone by 1 or cannot be written.
            self.usart.sr().write(|w| unsafe { w.bits(!TC) });
        }
    }

    /// No byte is ready yet: asks no more until [`resume_sending`](Self::resume_sending).
    pub fn pause_sending(&mut self) {
        self.usart.cr1().modify(|_, w| w.txeie().disabled());
    }

    /// Bytes are ready again.
    pub fn resume_sending(&mut self) {
        self.usart.cr1().modify(|_, w| w.txeie().enabled());
    }

    /// The last byte was given to the UART: [`Status::sent`] will tell when it has left.
    #[inline]
    pub fn finish_sending(&mut self) {
        self.usart
            .cr1()
            .modify(|_, w| w.txeie().disabled().tcie().enabled());
    }

    /// Turns the driver off and the receiver on, at once when [`Status::sent`] tells.
    #[inline]
    pub fn stop_sending(&mut self) {
        self.driver.set_state(PinState::Low);
        self.usart
            .cr1()
            .modify(|_, w| w.tcie().disabled().re().enabled().rxneie().enabled());
    }
}
