//! The RS-232 port of a board, with a terminal at its other end. Both directions are independent of each other.

use f103::periph::usart::{Sent, TxPin, Wire};
use f103::serial::Settings;
use f103::time::Time;

use crate::uart::{Byte, Uart};

/// The port and its terminal.
#[derive(Clone, Debug)]
pub struct Rs232 {
    uart: Uart,
    settings: Settings,
    received: Vec<Byte>,
    now: Time,
}

impl Rs232 {
    /// Returns a port whose terminal has this rate and format.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        let mut uart = Uart::default();
        uart.set(settings, true, Time::ZERO);
        Self {
            uart,
            settings,
            received: Vec::new(),
            now: Time::ZERO,
        }
    }

    /// Sets the rate and format of the terminal. A character that is being received is lost if one of them changes.
    pub fn set_settings(&mut self, settings: Settings) {
        self.settings = settings;
        self.uart.set(settings, true, self.now);
    }

    /// Returns the rate and format of the terminal.
    #[must_use]
    pub const fn settings(&self) -> Settings {
        self.settings
    }

    /// Sends bytes to the board from `at` on, without a gap, or after those that are still to be sent. Returns the end of
    /// the last stop bit.
    pub fn send(&mut self, at: Time, bytes: &[u8]) -> Time {
        // The edges up to the present have been passed on.
        let at = at.max(self.now + Time::from_ps(1));
        self.uart.send(at, bytes.iter().copied());
        self.uart.sent_until()
    }

    /// Returns the bytes that the board has sent since the last call, with their times. A damaged character counts, as on
    /// a terminal.
    pub fn take_received(&mut self) -> Vec<Byte> {
        core::mem::take(&mut self.received)
    }
}

impl Wire for Rs232 {
    fn sent(&mut self, sent: Sent) {
        self.uart.put_in(sent);
    }

    fn set_tx_pin(&mut self, pin: TxPin, now: Time) {
        self.uart.set_pin(pin, now.max(self.now));
    }

    fn advance(&mut self, to: Time) {
        self.now = to;
        while let Some(word) = self.uart.next_word(to) {
            self.received.push(Byte {
                byte: word.data as u8,
                start: word.start,
                end: word.end,
            });
        }
        self.uart.take_sent(to);
        self.uart.forget(to);
    }

    fn now(&self) -> Time {
        self.now
    }

    fn take_edges(&mut self) -> Vec<(Time, bool)> {
        self.uart.take_edges(self.now)
    }

    fn next_edge(&self) -> Option<Time> {
        self.uart.next_edge().map(|at| at.max(self.now))
    }

    fn has_edges(&self) -> bool {
        self.next_edge().is_some_and(|at| at <= self.now)
    }

    fn rx_level(&self) -> bool {
        self.uart.txd(self.now)
    }
}
