//! A USART in asynchronous mode, without LIN, smartcard, IrDA or flow control (RM0008 27).
//!
//! [`Usart::take_sent`] returns the characters that the USART has sent, and [`Usart::receive_edge`] adds an edge at its
//! RX pin. [`Usart::exchange`] does both with the [`Wire`] at its pins. All instants are whole cycles of the kernel
//! clock: a bit lasts BRR cycles (27.3.4: USARTDIV = BRR / 16, sixteen samples in a bit).
//!
//! The baud generator runs freely from the last write of BRR on, with sixteen ticks in a bit (27.3.4). The receiver
//! samples at the ticks, so it detects an edge up to a sixteenth of a bit late. The transmitter begins a character at
//! every sixteenth tick only, so up to a bit after the character was written.
//!
//! The manual leaves three points open. In this model:
//!
//! - the phase of the transmitter's clock begins with the write of BRR;
//! - clearing UE stops the receiver immediately, but the character that is being sent is sent to its end;
//! - a new BRR is in force immediately for the receiver, and from the next character on for the transmitter.

mod bits;
mod reception;
mod transmitter;
mod wire;

#[cfg(test)]
mod receiver_tests;
#[cfg(test)]
mod transmitter_tests;

use crate::peripheral::{Peripheral, Unmodelled};
use crate::serial::{Format, Parity, Receiver, Settings, Wave};
use crate::time::Time;
use bits::{cr1, cr2, cr3, sr};
pub use transmitter::Sent;
use transmitter::{Ended, Shape, Transmitter};
pub use wire::{TxPin, Wire};

/// Register offsets, RM0008 27.6.8.
mod offset {
    pub const SR: u32 = 0x00;
    pub const DR: u32 = 0x04;
    pub const BRR: u32 = 0x08;
    pub const CR1: u32 = 0x0C;
    pub const CR2: u32 = 0x10;
    pub const CR3: u32 = 0x14;
    pub const GTPR: u32 = 0x18;
}

/// The flags that reading SR and then DR clears: the errors and IDLE (27.6.1).
const CLEARED_BY_READ: u32 = sr::PE | sr::FE | sr::NE | sr::ORE | sr::IDLE;

/// Usual rates of lines, in bit/s.
const USUAL_RATES: [u32; 11] = [
    1200, 2400, 4800, 9600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600,
];

/// A USART.
#[derive(Clone, Debug)]
pub struct Usart {
    sr: u32,
    /// The flags that the last read of SR has returned: the first half of a clearing sequence.
    shown: u32,
    received: u16,
    brr: u32,
    cr1: u32,
    cr2: u32,
    cr3: u32,
    gtpr: u32,
    hz: u32,
    tx: Transmitter,
    rx_pin: Wave,
    /// The last two falling and the last two rising edges at the RX pin, until
    /// [`take_edges`](Self::take_edges).
    last_edges: [[Option<Time>; 2]; 2],
    receiver: Receiver,
    /// Whether IDLE can be set again (27.6.1: only after RXNE was set).
    idle_armed: bool,
    /// End of the last received character.
    quiet_since: Time,
    /// Number of writes to DR.
    data_writes: u64,
    /// Start of the baud generator at its present rate.
    baud_since: Time,
    /// Idle bits between two characters that are sent: a property of the part.
    idle_bits: u8,
}

impl Default for Usart {
    /// Returns a USART after reset, without a clock.
    fn default() -> Self {
        Self {
            sr: sr::RESET,
            shown: 0,
            received: 0,
            brr: 0,
            cr1: 0,
            cr2: 0,
            cr3: 0,
            gtpr: 0,
            hz: 0,
            tx: Transmitter::default(),
            rx_pin: Wave::default(),
            last_edges: [[None; 2]; 2],
            receiver: Receiver::default(),
            idle_armed: false,
            quiet_since: Time::ZERO,
            data_writes: 0,
            baud_since: Time::ZERO,
            idle_bits: 0,
        }
    }
}

impl Usart {
    /// Sets the number of idle bits between two characters that are sent.
    pub(crate) fn set_idle_bits(&mut self, bits: u8) {
        self.idle_bits = bits;
    }

    /// Returns the number of writes to the data register since the last reset, with those that were lost.
    #[must_use]
    pub const fn data_writes(&self) -> u64 {
        self.data_writes
    }

    /// Returns the output of the transmitter since the last call, in order. A character is included as soon as its
    /// start bit has begun.
    pub fn take_sent(&mut self) -> Vec<Sent> {
        self.tx.take_sent()
    }

    /// Returns the rate and format of the USART. A rate within 2 % of a usual one is rounded to it. `None` while the
    /// USART is off, or for a format that is not in [`Format`]. 7N2 is returned as 8N1, because the registers have the
    /// same values in both; only the words that are sent differ.
    #[must_use]
    pub fn settings(&self) -> Option<Settings> {
        let format = match (self.data_bits(), self.parity(), self.stop_bits()) {
            (8, None, 2) => Format::N2,
            (8, None, 1) => Format::N1,
            (8, Some(Parity::Even), 1) => Format::SevenE1,
            (8, Some(Parity::Odd), 1) => Format::SevenO1,
            (9, Some(Parity::Even), 1) => Format::E1,
            (9, Some(Parity::Odd), 1) => Format::O1,
            _ => return None,
        };
        if self.cr1 & cr1::UE == 0 || self.hz == 0 || self.brr < 16 {
            return None;
        }
        let exact = (self.hz + self.brr / 2) / self.brr;
        let usual = USUAL_RATES
            .into_iter()
            .find(|rate| exact.abs_diff(*rate) * 50 <= *rate);
        Some(Settings {
            baud: usual.unwrap_or(exact),
            format,
        })
    }

    fn data_bits(&self) -> u8 {
        if self.cr1 & cr1::M == 0 { 8 } else { 9 }
    }

    fn parity(&self) -> Option<Parity> {
        (self.cr1 & cr1::PCE != 0).then_some(if self.cr1 & cr1::PS == 0 {
            Parity::Even
        } else {
            Parity::Odd
        })
    }

    fn stop_bits(&self) -> u8 {
        if self.cr2 & cr2::STOP == cr2::STOP_TWO {
            2
        } else {
            1
        }
    }

    /// Returns the rate and format of the next character; `None` while the transmitter is off.
    fn shape(&self) -> Option<Shape> {
        let on = cr1::UE | cr1::TE;
        (self.cr1 & on == on && self.hz > 0 && self.brr >= 16).then(|| Shape {
            bit_cycles: self.brr,
            hz: self.hz,
            since: self.baud_since,
            data_bits: self.data_bits(),
            stop_bits: self.stop_bits(),
            idle_bits: self.idle_bits,
        })
    }

    /// Starts the next transmission, if one is waiting and the transmitter is on and free.
    fn start_next(&mut self, now: Time) {
        if let Some(Ended::More { took_data: true }) =
            self.shape().and_then(|shape| self.tx.start(now, shape))
        {
            self.sr |= sr::TXE;
        }
    }

    fn advance_transmitter(&mut self, now: Time) {
        while let Some(end) = self.tx.shift_end().filter(|&end| end <= now) {
            let (ended, was_break) = self.tx.finish(end, self.shape());
            if was_break {
                self.cr1 &= !cr1::SBK;
            }
            match ended {
                Ended::More { took_data } => {
                    if took_data {
                        self.sr |= sr::TXE;
                    }
                }
                // 27.3.2: TC is set when a frame was sent and TXE is set.
                Ended::Complete if !self.tx.holds_data() => self.sr |= sr::TC,
                Ended::Complete => {}
            }
        }
    }

    fn read_data(&mut self) -> u32 {
        let done = self.shown & CLEARED_BY_READ;
        self.sr &= !(done | sr::RXNE);
        self.shown &= !done;
        u32::from(self.received)
    }

    fn write_data(&mut self, value: u32, now: Time) -> Result<(), Unmodelled> {
        self.data_writes += 1;
        let done = self.shown & (sr::TC | sr::PE);
        self.sr &= !(done | sr::TXE);
        self.shown &= !done;
        let overwritten = self.tx.holds_data();
        self.tx.set_data(self.with_parity(value as u16));
        self.start_next(now);
        if overwritten {
            return Err(Unmodelled(
                "USART DR written while TXE = 0: the word before it is lost",
            ));
        }
        Ok(())
    }

    /// Returns the word as it is sent. With PCE set, its highest bit is the parity bit (27.3.7).
    fn with_parity(&self, data: u16) -> u16 {
        let bits = self.data_bits();
        match self.parity() {
            None => data & ((1 << bits) - 1),
            Some(parity) => {
                let payload = data & ((1 << (bits - 1)) - 1);
                payload | u16::from(parity.bit(payload)) << (bits - 1)
            }
        }
    }

    fn write_cr1(&mut self, value: u32, now: Time) -> Result<(), Unmodelled> {
        let value = value & cr1::MASK;
        let was = std::mem::replace(&mut self.cr1, value);
        let set = |bit: u32| value & !was & bit != 0;
        let mut finding = Ok(());
        if was & !value & cr1::TE != 0 && self.tx.stop(now) {
            finding = Err(Unmodelled(
                "USART CR1.TE cleared in the middle of a character",
            ));
        }
        if set(cr1::TE) || set(cr1::UE) && value & cr1::TE != 0 {
            self.tx.want_preamble();
        }
        if (value ^ was) & cr1::SBK != 0 {
            self.tx.want_break(value & cr1::SBK != 0);
        }
        let listens = |cr1: u32| cr1 & (cr1::UE | cr1::RE) == cr1::UE | cr1::RE;
        if listens(value) && !listens(was) {
            self.receiver = Receiver::listening_from(now);
            self.idle_armed = true;
            self.quiet_since = now;
        }
        self.start_next(now);
        if value & cr1::RWU != 0 {
            return Err(Unmodelled("USART mute mode (CR1.RWU)"));
        }
        if value & cr1::UE != 0 && self.brr < 16 {
            return Err(Unmodelled("USART enabled with USARTDIV below 1"));
        }
        finding
    }
}

impl Peripheral for Usart {
    fn read(&mut self, offset: u32, _now: Time) -> Result<u32, Unmodelled> {
        Ok(match offset {
            offset::SR => {
                self.shown = self.sr;
                self.sr
            }
            offset::DR => self.read_data(),
            offset::BRR => self.brr,
            offset::CR1 => self.cr1,
            offset::CR2 => self.cr2,
            offset::CR3 => self.cr3,
            offset::GTPR => self.gtpr,
            _ => return Err(Unmodelled("USART register")),
        })
    }

    fn write(&mut self, offset: u32, value: u32, now: Time) -> Result<(), Unmodelled> {
        match offset {
            offset::SR => self.sr &= value | !sr::RC_W0,
            offset::DR => return self.write_data(value, now),
            offset::BRR => {
                self.brr = value & 0xFFFF;
                self.baud_since = now;
                let busy = self.tx.is_sending() || self.receiver.start().is_some();
                self.start_next(now);
                if busy && self.cr1 & cr1::UE != 0 {
                    return Err(Unmodelled("USART BRR changed in the middle of a character"));
                }
            }
            offset::CR1 => return self.write_cr1(value, now),
            offset::CR2 => {
                self.cr2 = value & cr2::MASK;
                if value & (cr2::LINEN | cr2::CLKEN | cr2::LBDIE) != 0 {
                    return Err(Unmodelled("USART LIN or synchronous mode (CR2)"));
                }
                if !matches!(value & cr2::STOP, cr2::STOP_ONE | cr2::STOP_TWO) {
                    return Err(Unmodelled("USART half stop bits (CR2.STOP)"));
                }
            }
            offset::CR3 => {
                self.cr3 = value & cr3::MASK;
                if value & cr3::MASK & !(cr3::EIE | cr3::DMAR | cr3::DMAT) != 0 {
                    return Err(Unmodelled(
                        "USART flow control, half-duplex, smartcard or IrDA (CR3)",
                    ));
                }
            }
            offset::GTPR => {
                self.gtpr = value & 0xFFFF;
                if self.gtpr != 0 {
                    return Err(Unmodelled("USART guard time and prescaler (GTPR)"));
                }
            }
            _ => return Err(Unmodelled("USART register")),
        }
        Ok(())
    }

    fn next_event(&self) -> Option<Time> {
        let framing = self.framing().filter(|_| self.receiving());
        let word = framing.and_then(|framing| self.receiver.due(&framing));
        let idle = framing
            .filter(|_| self.cr1 & cr1::IDLEIE != 0 && self.receiver.is_idle())
            .and_then(|framing| self.idle_at(&framing, Time::MAX));
        [self.tx.shift_end(), word, idle]
            .into_iter()
            .flatten()
            .min()
    }

    fn advance(&mut self, now: Time) {
        self.advance_transmitter(now);
        self.advance_receiver(now);
    }

    /// See 27.3.13.
    fn dma_requests(&self) -> [bool; 2] {
        let on = |enable, flag| self.cr3 & enable != 0 && self.sr & flag != 0;
        let transmits = self.cr1 & (cr1::UE | cr1::TE) == cr1::UE | cr1::TE;
        [on(cr3::DMAR, sr::RXNE), transmits && on(cr3::DMAT, sr::TXE)]
    }

    /// See 27.4, table 196.
    fn irq(&self) -> bool {
        let error = cr3::EIE | cr3::DMAR;
        if self.cr3 & error == error && self.sr & (sr::FE | sr::ORE | sr::NE) != 0 {
            return true;
        }
        [
            (cr1::TXEIE, sr::TXE),
            (cr1::TCIE, sr::TC),
            (cr1::RXNEIE, sr::RXNE | sr::ORE),
            (cr1::IDLEIE, sr::IDLE),
            (cr1::PEIE, sr::PE),
        ]
        .into_iter()
        .any(|(enable, flags)| self.cr1 & enable != 0 && self.sr & flags != 0)
    }

    fn reset(&mut self, now: Time) {
        self.tx.stop(now);
        let sent = self.tx.take_sent();
        *self = Self {
            hz: self.hz,
            baud_since: now,
            tx: Transmitter::with_sent(sent),
            rx_pin: Wave::new(self.rx_pin.last_level()),
            last_edges: self.last_edges,
            idle_bits: self.idle_bits,
            ..Self::default()
        };
    }

    fn set_clock(&mut self, hz: u32, now: Time) {
        if hz != self.hz {
            self.baud_since = now;
        }
        self.hz = hz;
        self.start_next(now);
    }
}
